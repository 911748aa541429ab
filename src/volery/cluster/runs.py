"""Runs of a study: their identity and their results, as plain data.

The identity of a run is a hash of the scenario's content with the run's parameters, of the files
that it names, of the seed, the duration, the sampling rate, the code of Volery and the versions of
packages. Equal identities mean equal results, so a result that exists is not computed again.
"""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

from volery.cluster.loading import LoadedStudy
from volery.cluster.points import Point
from volery.core.machine import describe_versions
from volery.scenario.file_names import named_files
from volery.verdicts.verdict import Verdict

_PACKAGE = Path(__file__).resolve().parent.parent
_ID_DIGITS = 24


@dataclass(frozen=True)
class RunSpec:
    """One run: a parameter point and a seed."""

    id: str
    """Identity, a hash; the name of the result's file."""
    point: int
    """Number of the parameter point."""
    repetition: int
    """Number of the run among those of its point, from 0."""
    values: Point
    """Values of the point by parameter."""
    seed: int
    """Seed of the scenario."""


@dataclass(frozen=True)
class RunResult:
    """The result of one run; of a failed one, the reason."""

    id: str
    """Identity of the run."""
    status: str
    """`done` or `failed`."""
    parameters: Mapping[str, Any]
    """Values of the parameters by name."""
    seed: int
    """Seed of the scenario."""
    version: str
    """Version of Volery, with a hash of its code."""
    metrics: Mapping[str, float] = field(default_factory=dict)
    """Values by name; a metric that returns several has the names `metric.name`."""
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    """Hashes of the metrics that were computed, by name."""
    verdicts: Sequence[Mapping[str, Any]] = ()
    """Verdicts on the expectations, as data of `Verdict`; empty: no metric reads them."""
    digest: str = ""
    """SHA-256 of the sampled states and the events."""
    simulated_s: float = 0.0
    """Simulated time, s."""
    wall_s: float = 0.0
    """Wall time, s; of one of K environments, a Kth of theirs."""
    cpu_s: float = 0.0
    """CPU time, s, likewise."""
    error: str = ""
    """Reason of a failure in one line."""
    traceback: str = ""
    """Traceback of a failure."""
    log: str = ""
    """Log of the run, relative to the results folder; empty: none."""

    @property
    def is_failed(self) -> bool:
        """Whether the run failed."""
        return self.status == "failed"

    @property
    def is_passed(self) -> bool:
        """Whether the run has not failed, and passes the expectations that were judged."""
        passed = all(Verdict.from_data(each).is_passed for each in self.verdicts)
        return passed and not self.is_failed

    def to_json(self) -> str:
        """Returns the result as JSON."""
        return json.dumps(vars(self), default=str) + "\n"

    @classmethod
    def from_json(cls, text: str) -> RunResult:
        """Returns a result written by `to_json`. Raises `ValueError` if the text is none."""
        data = json.loads(text)
        if not isinstance(data, dict) or data.keys() != {each.name for each in fields(cls)}:
            raise ValueError("not the result of a run")
        return cls(**data)


@cache
def code_version() -> str:
    """Returns the version of Volery with a hash of its source files: `0.1.0+1a2b3c4d5e6f`."""
    from volery import __version__

    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:12]}"


@cache
def versions() -> dict[str, str]:
    """Returns the versions on which results depend: of Volery's code, Python and packages."""
    return {"volery's code": code_version(), **describe_versions()}


def difference(own: Mapping[str, str], others: Any) -> str:
    """Returns the first difference of two machines' versions, as text; empty: none.

    others: what another machine has sent.
    """
    for name, version in own.items():
        other = others.get(name) if isinstance(others, Mapping) else None
        if other != version:
            return f"{name} {str(other)[:80]} instead of {version}"
    return ""


def failure_of(run: RunSpec, error: BaseException | str, log: str = "") -> RunResult:
    """Returns the result of a failed run; an error is an exception or a sentence."""
    if isinstance(error, str):
        line, trace = error, ""
    else:
        line = f"{type(error).__name__}: {error}"
        trace = "".join(traceback.format_exception(error))
    return RunResult(
        id=run.id,
        status="failed",
        parameters=dict(run.values),
        seed=run.seed,
        version=code_version(),
        error=" ".join(line.split()),
        traceback=trace,
        log=log,
    )


def runs_of(loaded: LoadedStudy, points: Sequence[int] | None = None) -> Iterator[RunSpec]:
    """Yields the runs of a study, point by point, each with all its seeds.

    points: numbers of the parameter points; None: all. Raises `StudyError` for an invalid value.
    """
    for number in range(len(loaded.points)) if points is None else points:
        values = loaded.points[number]
        content = point_hash(loaded, values)
        for repetition, seed in enumerate(loaded.seeds_of(values)):
            identity = hashlib.sha256(f"{content} {seed}".encode()).hexdigest()[:_ID_DIGITS]
            yield RunSpec(identity, number, repetition, values, seed)


def point_hash(loaded: LoadedStudy, values: Point) -> str:
    """Returns a hash of everything but the seed that the runs of a parameter point depend on."""
    scenario = loaded.scenario_of(values)
    data = scenario.data()
    data.pop("seed", None)
    content = {
        "scenario": data,
        "files": _file_hashes(tuple(sorted(named_files(data, scenario.access.folder)))),
        "world_seed": scenario.world.seed,
        "duration_s": loaded.duration_s,
        "sample_rate_hz": loaded.study.sample_rate_hz,
        "versions": versions(),
        "parameters": values,
    }
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _file_hashes(files: tuple[Path, ...]) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
