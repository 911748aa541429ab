"""The results of a study as a table: one row for each run, in the order of the study."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cluster.metric_names import UNREPEATABLE
from volery.cluster.runs import RunResult, RunSpec
from volery.core.errors import VoleryError
from volery.core.extras import import_extra

if TYPE_CHECKING:
    import pandas
    import pyarrow

_UNREPEATABLE = ("wall_s", "cpu_s", *UNREPEATABLE)


class StudyTable:
    """Rows of runs: `run`, `point`, `repetition`, `seed`, parameters, `status`, metrics and others.

    `table["success"]` is a column as a list; iteration yields rows as dicts. Values of parameters
    that are lists or tables are JSON. Metrics of failed runs are None.
    """

    def __init__(
        self,
        runs: Sequence[RunSpec],
        results: Mapping[str, RunResult],
        parameters: Sequence[str],
        metrics: Sequence[str],
        folder: Path | None = None,
    ) -> None:
        self.parameters = tuple(parameters)
        """Names of the columns with parameters."""
        self.folder = folder
        """Folder of the results; None: they are not on a disk."""
        rows = [(run, results[run.id]) for run in runs if run.id in results]
        self.metrics = _metric_names([result for _, result in rows], metrics)
        """Names of the columns with metrics."""
        self.columns: dict[str, list[Any]] = _columns(rows, self.parameters, self.metrics)
        """Columns by name."""
        self.tracebacks = {run.id: result.traceback for run, result in rows if result.is_failed}
        """Tracebacks of failed runs, by run."""

    def __len__(self) -> int:
        """Returns the number of runs."""
        return len(self.columns["run"])

    def __getitem__(self, column: str) -> list[Any]:
        """Returns a column. Raises `VoleryError` for an unknown name."""
        try:
            return self.columns[column]
        except KeyError:
            known = ", ".join(self.columns)
            raise VoleryError(f"the table has no column '{column}'; it has {known}") from None

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Iterates over the rows."""
        for values in zip(*self.columns.values(), strict=True):
            yield dict(zip(self.columns, values, strict=True))

    def __repr__(self) -> str:
        return f"StudyTable({len(self)} runs, {self.num_failed} failed; {', '.join(self.columns)})"

    @property
    def num_failed(self) -> int:
        """Number of failed runs."""
        return sum(status == "failed" for status in self.columns["status"])

    @property
    def repeatable(self) -> dict[str, list[Any]]:
        """Columns that are equal whenever the study is flown again: all but times and speed."""
        return {name: c for name, c in self.columns.items() if name not in _UNREPEATABLE}

    def to_arrow(self) -> pyarrow.Table:
        """Returns a table of pyarrow. Raises `VoleryError` without pyarrow."""
        return arrow_module("to_arrow()").table(self.columns)

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table of pandas. Raises `VoleryError` without pandas."""
        from volery.core.data_frames import data_frame

        return data_frame(self.columns)

    def parquet(self) -> bytes:
        """Returns the table as the content of a Parquet file. Raises `VoleryError` if it fails."""
        arrow = arrow_module("a table of runs")
        from pyarrow import parquet

        sink = arrow.BufferOutputStream()
        parquet.write_table(self.to_arrow(), sink)  # type: ignore[no-untyped-call]
        content: bytes = sink.getvalue().to_pybytes()
        return content


def arrow_module(what: str) -> Any:
    """Imports pyarrow. Raises `VoleryError` with the command that installs it."""
    return import_extra(what, "pyarrow", "pyarrow", "sweep")


def _metric_names(results: Sequence[RunResult], metrics: Sequence[str]) -> tuple[str, ...]:
    """Returns the columns of metrics: those of the study, or their `metric.name` columns."""
    found: dict[str, None] = {}
    names = dict.fromkeys(name for result in results for name in result.metrics)
    for metric in metrics:
        inner = [name for name in names if name == metric or name.startswith(f"{metric}.")]
        found.update(dict.fromkeys(inner or [metric]))
    return tuple(found)


def _columns(
    rows: Sequence[tuple[RunSpec, RunResult]],
    parameters: Sequence[str],
    metrics: Sequence[str],
) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {
        "run": [run.id for run, _ in rows],
        "point": [run.point for run, _ in rows],
        "repetition": [run.repetition for run, _ in rows],
        "seed": [run.seed for run, _ in rows],
    }
    for name in parameters:
        columns[name] = _one_type([_cell(run.values[name]) for run, _ in rows])
    columns["status"] = [result.status for _, result in rows]
    for name in metrics:
        columns[name] = [result.metrics.get(name) for _, result in rows]
    for name in ("digest", "simulated_s", "wall_s", "cpu_s", "error", "log", "version"):
        columns[name] = [getattr(result, name) for _, result in rows]
    return columns


def _cell(value: Any) -> Any:
    return value if isinstance(value, bool | int | float | str) else json.dumps(value)


def _one_type(values: list[Any]) -> list[Any]:
    """Returns values of one type: numbers as floats if some are, everything as text if mixed."""
    kinds = {type(value) for value in values}
    if kinds <= {int, float} and len(kinds) > 1:
        return [float(value) for value in values]
    return values if len(kinds) <= 1 else [str(value) for value in values]
