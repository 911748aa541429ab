"""Pictures of ways: simulated against estimated, or a real flight over the simulated one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.report.charts import as_svg, new_axes
from volery.report.palette import FAINT, INK, UAV_COLORS

Array = NDArray[np.float64]

_MAP_SIZE = (7.2, 6.4)
_POINTS = 1500
_STYLES = ("-", (0, (4, 2)))
"""Lines come in pairs, the second of each dashed."""


class Line(NamedTuple):
    """A way as it is drawn."""

    label: str
    time_s: Array
    """(N,)"""
    position: Array
    """(N, 3) m"""


def ways_from_above(lines: Sequence[Line], trunks: Array) -> str:
    """Ways over the map of trunks (T, 2 or 3), as SVG."""
    figure, axes = new_axes(*_MAP_SIZE)
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


def over_time(lines: Sequence[Line], axis: int) -> str:
    """One coordinate of ways over time, as SVG; axis 0 is x, 1 is y, 2 is z."""
    figure, axes = new_axes()
    for number, line in enumerate(lines):
        every = max(len(line.time_s) // _POINTS, 1)
        x, y = line.time_s[::every], line.position[::every, axis]
        axes.plot(x, y, label=line.label, **_style(number))
    axes.set_xlabel("time, s")
    axes.set_ylabel(f"{'xyz'[axis]}, m")
    figure.legend(loc="outside upper left", ncols=3, frameon=False, labelcolor=INK)
    return as_svg(figure)


def _style(number: int) -> dict[str, Any]:
    return {"color": UAV_COLORS[number % len(UAV_COLORS)], "ls": _STYLES[number % 2], "lw": 1.6}
