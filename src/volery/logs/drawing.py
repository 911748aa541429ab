"""Draws fields of logs over time, and paths from above, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.figures.notebook import new_axes, png_html
from volery.logs.fields import Column

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DATES_S = 1e8
"""Times above it, s, are Unix times: no run lasts as long."""
_POINTS = 5000
"""Max points of a path."""
_LEGEND_LIMIT = 12


def draw_fields(
    topic: str, times_s: Array, columns: Mapping[str, Column], axes: Axes | None
) -> Axes:
    """Draws fields of numbers over time, each component of a message or array as a line.

    times_s: (n,). Raises `VoleryError` if a column holds no numbers.
    """
    for name, values in columns.items():
        if values.dtype == object or values.dtype.kind not in "iufb":
            raise VoleryError(f"'{name}' of {topic} cannot be plotted: it holds no numbers")
    axes = new_axes() if axes is None else axes
    times, label = _clock_of(times_s)
    for name, values in columns.items():
        if values.ndim == 1:
            axes.plot(times, values, label=f"{topic} {name}")
        else:
            for k, line in enumerate(values.T):
                axes.plot(times, line, label=f"{topic} {name}[{k}]")
    axes.set_xlabel(label)
    if len(columns) == 1:
        axes.set_ylabel(next(iter(columns)))
    if len(axes.lines) <= _LEGEND_LIMIT:
        axes.legend()
    return axes


def draw_paths(paths: Mapping[str, Array], axes: Axes | None) -> Axes:
    """Draws paths (n, 3), m, by label from above."""
    axes = new_axes() if axes is None else axes
    for label, position in paths.items():
        every = max(len(position) // _POINTS, 1)
        x, y = position[::every, :2].T
        (line,) = axes.plot(x, y, label=label)
        axes.plot(x[-1:], y[-1:], "o", color=line.get_color())
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.grid(visible=True, alpha=0.3)
    if len(paths) <= _LEGEND_LIMIT:
        axes.legend()
    return axes


def paths_html(paths: Mapping[str, Array]) -> str:
    """Returns paths (n, 3), m, by label as an `<img>`; empty without any."""
    if not paths:
        return ""
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    draw_paths(paths, figure.add_subplot())
    file = BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return png_html(file.getvalue())


def _clock_of(times_s: Array) -> tuple[Array, str]:
    """Returns times to draw, s, and the label of their axis."""
    if not len(times_s) or times_s[0] < _DATES_S:
        return times_s, "time, s"
    start_s = float(np.floor(times_s[0]))
    date = f"{datetime.fromtimestamp(start_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
    return times_s - start_s, f"time since {date}, s"
