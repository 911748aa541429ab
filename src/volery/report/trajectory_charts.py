"""Charts of trajectories: simulated against estimated, or a real flight over the simulated one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import EllipseCollection

from volery.core.arrays import Array
from volery.figures.charts import as_svg, new_axes
from volery.figures.palette import FAINT, INK, UAV_COLORS
from volery.report.true_trunks import TrueTrunks

_MAP_SIZE = (7.2, 6.4)
_POINTS = 1500
_MIN_FRACTION = 0.012
"""Min width of a ring, as a fraction of the map's."""
_DATES_S = 1e8
"""Threshold between run times and Unix times, s: no run lasts as long; Unix time passed it in
1973.
"""
_STYLES = ("-", (0, (4, 2)))
"""Line styles of pairs; the second line of each is dashed."""


class ChartLine(NamedTuple):
    """A trajectory to draw."""

    label: str
    time_s: Array
    """(N,)"""
    position: Array
    """(N, 3) m"""


def trajectories_from_above(lines: Sequence[ChartLine], trunks: Array, true: TrueTrunks) -> str:
    """Draws trajectories over the map of trunks (T, 2 or 3) and true ones, rings; returns SVG."""
    figure, axes = new_axes(*_MAP_SIZE)
    if len(true.positions):
        _rings(axes, true)
    if len(trunks):
        axes.plot(*trunks[:, :2].T, ".", color=FAINT, markersize=4, label="trunks, by the estimate")
    for number, line in enumerate(lines):
        every = max(len(line.position) // _POINTS, 1)
        x, y = line.position[::every, :2].T
        axes.plot(x, y, label=line.label, **_style(number))
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    figure.legend(loc="outside upper left", ncols=3, frameon=False, labelcolor=INK)
    return as_svg(figure)


def over_time(lines: Sequence[ChartLine], axis: int) -> str:
    """Draws one coordinate of trajectories over time; axis 0 is x, 1 y, 2 z. Returns SVG."""
    figure, axes = new_axes()
    start_s, clock = clock_of(float(line.time_s[0]) for line in lines if len(line.time_s))
    for number, line in enumerate(lines):
        every = max(len(line.time_s) // _POINTS, 1)
        x, y = line.time_s[::every] - start_s, line.position[::every, axis]
        axes.plot(x, y, label=line.label, **_style(number))
    axes.set_xlabel(clock)
    axes.set_ylabel(f"{'xyz'[axis]}, m")
    figure.legend(loc="outside upper left", ncols=3, frameon=False, labelcolor=INK)
    return as_svg(figure)


def is_date(time_s: float) -> bool:
    """Returns whether a time is Unix time rather than time since a run's start."""
    return time_s > _DATES_S


def date_text(time_s: float) -> str:
    """Returns a Unix time as text."""
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M:%S} UTC"


def clock_of(starts_s: Iterable[float]) -> tuple[float, str]:
    """Returns the origin of a time axis, s, for data that begin at these times, and its label."""
    first_s = min(starts_s, default=0.0)
    if not is_date(first_s):
        return 0.0, "time, s"
    start_s = math.floor(first_s)
    return float(start_s), f"time since {date_text(start_s)}, s"


def _rings(axes: Any, true: TrueTrunks) -> None:
    """Draws true trunks as rings of their width, or of the min visible width."""
    spread = float(np.ptp(true.positions, axis=0).max())
    widths = np.maximum(true.widths_m, _MIN_FRACTION * spread)
    axes.add_collection(
        EllipseCollection(
            *(widths, widths, 0.0),
            units="xy",
            offsets=true.positions,
            transOffset=axes.transData,
            facecolors="none",
            edgecolors=INK,
            linewidths=0.5,
            alpha=0.6,
        )
    )
    axes.plot(
        *([], [], "o"), color=INK, alpha=0.6, fillstyle="none", markersize=5, label="true trunks"
    )


def _style(number: int) -> dict[str, Any]:
    return {"color": UAV_COLORS[number % len(UAV_COLORS)], "ls": _STYLES[number % 2], "lw": 1.6}
