"""What a driver sends to workers, and what they return: plain data, for any transport."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from volery.cluster.points import Point
from volery.cluster.runs import RunResult, RunSpec
from volery.cluster.study import Study


@dataclass(frozen=True)
class StudyJob:
    """What a worker needs to know of a study, once."""

    study: Study
    """The study."""
    where: str
    """Its name in errors."""
    folder: Path
    """Folder of relative names."""
    is_trusted: bool
    """Whether code from the folders of the study and the scenario may run."""
    first_point: Point
    """A parameter point, whose simulation is built before the first run."""
    results: Path
    """Folder for logs; it exists."""


@dataclass(frozen=True)
class RunBatch:
    """Runs that a worker flies one after the other or, if it is `vectorized`, together."""

    number: int
    """Number among the batches of a driver."""
    runs: tuple[RunSpec, ...]
    """The runs; those of a vectorized batch have one parameter point."""
    vectorized: bool = False
    """Whether the runs are environments of one simulation."""
    record: bool = False
    """Whether a log of each run is kept."""
    plain: bool = False
    """Whether each run is a plain simulation with all its sensors, for a comparison."""


@dataclass(frozen=True)
class Preparation:
    """What a worker found out before its first run."""

    versions: Mapping[str, str]
    """Versions on which results depend; see `runs.versions`."""
    obstacle: str = ""
    """What keeps runs from being environments; empty: nothing."""
    max_environments: int = 1
    """Environments of one batch that fit into memory."""
    error: str = ""
    """Why no run of the study can start; empty: they can."""


@dataclass(frozen=True)
class BatchResult:
    """The results of a batch."""

    number: int
    """Number of the batch."""
    results: tuple[RunResult, ...]
    """Results in the order of the batch's runs."""
