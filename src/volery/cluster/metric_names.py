"""Names of metrics: the built-in ones, those of a study, and where a user's functions are.

The process that drives a study imports no user's code: it only finds files and hashes them.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from volery.cluster.errors import StudyError
from volery.cluster.study import Study, StudyMetric
from volery.core.errors import reason_of
from volery.core.near_names import near_miss

BUILT_IN: dict[str, str] = {
    "success": "low",
    "collisions": "high",
    "crashed": "high",
    "distance_m": "high",
    "time_s": "high",
    "max_speed_m_s": "high",
    "clearance_m": "low",
    "separation_m": "low",
    "energy_wh": "high",
    "ate_m": "high",
    "area_m2": "low",
    "real_time_factor": "low",
    "expectations": "low",
}
"""Built-in metrics, and which of their values are bad; docs/sweeps.md explains them."""
UNREPEATABLE = ("real_time_factor",)
"""Built-in metrics that differ when a run is repeated."""
_FUNCTION = re.compile(r"(?P<module>[\w./-]+\.py|[A-Za-z_][\w.]*):(?P<name>[A-Za-z_]\w*)")


@dataclass(frozen=True)
class MetricEntry:
    """A metric of a study."""

    name: str
    """Name in the table."""
    function: str
    """Built-in metric, `module:function` or `file.py:function`."""
    parameters: tuple[tuple[str, object], ...] = ()
    """Further arguments of the function."""
    worst: str = "high"
    """Which values are bad: low or high."""

    @property
    def is_built_in(self) -> bool:
        """Whether Volery computes it."""
        return self.function in BUILT_IN


def metrics_of(study: Study) -> tuple[MetricEntry, ...]:
    """Returns the metrics of a study, in order."""
    return tuple(_entry(metric) for metric in study.metrics)


def _entry(metric: str | StudyMetric) -> MetricEntry:
    if isinstance(metric, str):
        return MetricEntry(metric.rpartition(":")[2], metric, (), BUILT_IN.get(metric, "high"))
    function = metric.function or metric.name
    worst = metric.worst or BUILT_IN.get(function, "high")
    return MetricEntry(metric.name, function, tuple(metric.parameters.items()), worst)


def check_metrics(study: Study, where: str, folder: Path, *, is_trusted: bool) -> None:
    """Raises `StudyError` for an unknown metric, a missing file or code that may not run."""
    entries = metrics_of(study)
    names = [entry.name for entry in entries]
    for name in names:
        if names.count(name) > 1:
            raise StudyError(f"{where}: key 'metrics': two metrics are named '{name}'")
    for entry in entries:
        if not entry.is_built_in:
            _check_function(entry.function, where, folder, is_trusted=is_trusted)
    for key, table in (("stop", study.stop), ("worst", study.worst)):
        if table is not None and table.metric not in names:
            raise StudyError(
                f"{where}: key '{key}.metric': '{table.metric}' is not one of the study's "
                f"metrics{near_miss(table.metric, names)} Known: {', '.join(names)}"
            )


def _check_function(function: str, where: str, folder: Path, *, is_trusted: bool) -> None:
    if not _FUNCTION.fullmatch(function):
        raise StudyError(
            f"{where}: key 'metrics': no metric '{function}'{near_miss(function, BUILT_IN)} "
            f"Built in: {', '.join(BUILT_IN)}; your own: module:function or file.py:function"
        )
    module = function.partition(":")[0]
    if source_of(function, folder) is None and module.endswith(".py"):
        raise StudyError(f"{where}: key 'metrics': {function}: no file {folder / module}")
    if not is_trusted:
        raise StudyError(
            f"{where}: runs code of its own ({module}); give --trust if it is yours, or "
            "trust=True in Python"
        )


def source_of(function: str, folder: Path) -> Path | None:
    """Returns the file of a user's function; None: it has none, or there is no such module."""
    module = function.partition(":")[0]
    if module.endswith(".py"):
        path = folder / module
        return path if path.is_file() else None
    search_paths: list[str] | None = None
    spec = None
    for k, part in enumerate(module.split(".")):
        name = ".".join(module.split(".")[: k + 1])
        spec = (
            PathFinder.find_spec(name, search_paths)
            or (k == 0 and _local_spec(part, folder))
            or None
        )
        if spec is None:
            return None
        search_paths = list(spec.submodule_search_locations or ())
    return Path(spec.origin) if spec is not None and spec.origin else None


def fingerprint_of(entry: MetricEntry, folder: Path) -> str:
    """Returns a hash of a metric: its function, parameters and, of a user's function, its file.

    Raises `StudyError` if the file cannot be read.
    """
    digest = hashlib.sha256(f"{entry.function} {sorted(map(str, entry.parameters))}".encode())
    source = None if entry.is_built_in else source_of(entry.function, folder)
    if source is not None:
        try:
            digest.update(source.read_bytes())
        except OSError as error:
            raise StudyError(f"{source}: cannot be read: {reason_of(error)}") from None
    return digest.hexdigest()[:16]


def _local_spec(top: str, folder: Path) -> ModuleSpec | None:
    return PathFinder.find_spec(top, [str(folder), str(Path().resolve())])
