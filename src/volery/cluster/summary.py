"""Means of a study's metrics by parameter point, with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from volery.cluster.confidence import MeanEstimate, estimate_mean
from volery.cluster.table import StudyTable


@dataclass(frozen=True)
class PointSummary:
    """The runs of one parameter point."""

    point: int
    """Number of the point."""
    values: tuple[Any, ...]
    """Values of the parameters."""
    runs: int
    """Number of runs."""
    failed: int
    """Failed runs among them."""
    means: dict[str, MeanEstimate]
    """Means by metric."""


def summarize(table: StudyTable, confidence: float = 0.95) -> list[PointSummary]:
    """Returns the parameter points of a table in order."""
    rows: dict[int, list[int]] = {}
    for row, point in enumerate(table["point"]):
        rows.setdefault(point, []).append(row)
    return [_summary(table, point, chosen, confidence) for point, chosen in rows.items()]


def finite_values(table: StudyTable, metric: str, rows: Sequence[int] | None = None) -> list[float]:
    """Returns the finite values of a metric in some rows of the table; None: in all."""
    column = table[metric]
    values = column if rows is None else [column[row] for row in rows]
    return [value for value in values if value is not None and math.isfinite(value)]


def point_rows(table: StudyTable) -> tuple[list[str], list[list[str]]]:
    """Returns head and rows of a table of points for users: mean and half width of an interval."""
    head = [*table.parameters, "runs", "failed", *table.metrics]
    rows = []
    for each in summarize(table):
        means = [estimate_text(each.means[name]) for name in table.metrics]
        rows.append([*map(value_text, each.values), f"{each.runs:,}", f"{each.failed:,}", *means])
    return head, rows


def estimate_text(estimate: MeanEstimate) -> str:
    """Returns a mean with its interval, `1.23 ± 0.05` or `1 [0.84, 1]`; empty without values."""
    if not estimate.count:
        return ""
    if not math.isfinite(estimate.half_width):
        return f"{estimate.mean:.4g}"
    middle = (estimate.low + estimate.high) / 2.0
    if not math.isclose(middle, estimate.mean, rel_tol=1e-6, abs_tol=1e-12):
        return f"{estimate.mean:.3g} [{estimate.low:.2g}, {estimate.high:.2g}]"
    return f"{estimate.mean:.4g} ± {estimate.half_width:.2g}"


def value_text(value: Any) -> str:
    """Returns a parameter's value for users."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _summary(table: StudyTable, point: int, rows: Sequence[int], confidence: float) -> PointSummary:
    return PointSummary(
        point,
        tuple(table[name][rows[0]] for name in table.parameters),
        len(rows),
        sum(table["status"][row] == "failed" for row in rows),
        {n: estimate_mean(finite_values(table, n, rows), confidence) for n in table.metrics},
    )
