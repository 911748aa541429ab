"""Charts of a team: its formation at some moments, its cost, distances and energy, as SVG."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from volery.core.arrays import Array
from volery.figures.charts import as_svg, new_axes, new_panels, thinned
from volery.figures.palette import FAINT, INK, UAV_COLORS

_COLUMNS = 3
_PANEL = 2.4
"""Side of the view of a moment, in inches."""
_DOT_POINTS = 13.0
_STILL_M_S = 0.2
"""Speed below which a team has no heading."""
_BAR = 0.3
_MIN_COST = 1e-4
_LINE: dict[str, Any] = {"marker": ".", "ms": 4, "lw": 1.6}
_BOUND: dict[str, Any] = {"color": FAINT, "lw": 1.0, "ls": (0, (4, 2))}


class TeamMoment(NamedTuple):
    """A formation of M UAVs at a moment."""

    title: str
    names: Sequence[str]
    offset: Array
    """(M, 2) m from their middle, in the map."""
    velocity: Array
    """(2,) m/s, mean."""


class TimeAxis(NamedTuple):
    """The time axis of a chart, with its marks; times are s."""

    label: str
    end_s: float
    searches: Array
    """(S,) times at which searches begin."""
    solved_s: float
    """Time of the first V; NaN: none."""


def formation_views(moments: Sequence[TeamMoment]) -> str:
    """Draws formations from above in equal scale; returns SVG."""
    columns = min(_COLUMNS, len(moments))
    rows = -(-len(moments) // columns)
    width, height = columns * _PANEL + 0.5, rows * (_PANEL + 0.3) + 0.3
    figure, panels = new_panels(len(moments), width, height, columns)
    spread = max(float(np.abs(moment.offset).max(initial=1.0)) for moment in moments)
    for axes, moment in zip(panels, moments, strict=True):
        _draw_formation(axes, moment, 1.25 * spread)
    for number, axes in enumerate(panels):
        axes.tick_params(
            labelleft=number % columns == 0, labelbottom=number + columns >= len(panels)
        )
    figure.supxlabel("x from the middle, m", color=FAINT, fontsize=10)
    figure.supylabel("y from the middle, m", color=FAINT, fontsize=10)
    return as_svg(figure)


def _draw_formation(axes: Axes, moment: TeamMoment, limit: float) -> None:
    axes.set_title(moment.title, fontsize=10, color=INK)
    axes.set_xlim(-limit, limit)
    axes.set_ylim(-limit, limit)
    axes.set_aspect("equal")
    colors = [UAV_COLORS[0]] * len(moment.names)
    speed = float(np.hypot(*moment.velocity))
    if speed > _STILL_M_S:
        heading = moment.velocity / speed
        colors[int(np.argmax(moment.offset @ heading))] = UAV_COLORS[1]
        x, y = (0.3 * limit * heading).tolist()
        axes.annotate(
            "",
            (x, y),
            (0.0, 0.0),
            arrowprops={"arrowstyle": "->", "color": FAINT, "lw": 1.2},
            zorder=1.0,
        )
    axes.scatter(
        moment.offset[:, 0], moment.offset[:, 1], s=_DOT_POINTS**2, c=colors, linewidths=0.0
    )
    for name, (x, y) in zip(moment.names, moment.offset.tolist(), strict=True):
        number = re.search(r"\d{1,3}$", name)
        if number is not None:
            axes.text(x, y, number[0], ha="center", va="center_baseline", fontsize=7, color="#fff")


def lines_over_time(
    time_s: Array, lines: Mapping[str, Array], label: str, time_axis: TimeAxis
) -> str:
    """Draws numbers (K,) by name over times (K,) s; returns SVG."""
    figure, axes = new_axes()
    for number, (name, values) in enumerate(lines.items()):
        axes.plot(time_s, values, color=UAV_COLORS[number], label=name, **_LINE)
    _finish(figure, axes, label, time_axis)
    return as_svg(figure)


def cost_over_time(time_s: Array, cost: Array, lost_cost: float, time_axis: TimeAxis) -> str:
    """Draws the cost (K,) of a formation on a logarithmic scale; returns SVG."""
    figure, axes = new_axes()
    axes.plot(time_s, np.maximum(cost, _MIN_COST), color=UAV_COLORS[0], label="cost", **_LINE)
    axes.set_yscale("log")
    if np.isfinite(lost_cost):
        axes.axhline(lost_cost, label=f"lost above {lost_cost:g}", **_BOUND)
    _finish(figure, axes, "cost of the formation", time_axis)
    return as_svg(figure)


def distance_over_time(
    time_s: Array, distance_m: Array, bound_m: float, time_axis: TimeAxis
) -> str:
    """Draws the minimum distance (T,) m between UAVs, and its bound, if any; returns SVG."""
    figure, axes = new_axes()
    keep = thinned(distance_m, lowest=True)
    axes.plot(time_s[keep], distance_m[keep], color=UAV_COLORS[0], lw=1.6, label="measured")
    if np.isfinite(bound_m):
        axes.axhline(bound_m, label=f"planned: {bound_m:g} m", **_BOUND)
    _finish(figure, axes, "minimum distance, m", time_axis)
    axes.set_ylim(0.0, None)
    return as_svg(figure)


def energy_bars(energy_wh: Mapping[str, float]) -> str:
    """Draws the energy used by each UAV, Wh; returns SVG."""
    figure, axes = new_axes(height=max(1.0 + _BAR * len(energy_wh), 2.0))
    rows = np.arange(len(energy_wh))[::-1]
    axes.barh(rows, list(energy_wh.values()), height=0.62, color=UAV_COLORS[0])
    axes.set_yticks(rows, list(energy_wh), parse_math=False)
    axes.set_xlabel("energy used, Wh")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    return as_svg(figure)


def _finish(figure: Figure, axes: Axes, label: str, time_axis: TimeAxis) -> None:
    """Marks searches and the first V, and labels the axes."""
    for number, time_s in enumerate(time_axis.searches.tolist()):
        word = "" if number else "a search begins"
        axes.axvline(time_s, color=FAINT, lw=1.0, ls=":", label=word)
    if np.isfinite(time_axis.solved_s):
        axes.axvline(time_axis.solved_s, color=UAV_COLORS[2], lw=1.2, label="first V")
    axes.set_xlim(0.0, max(time_axis.end_s, 1e-3))
    axes.set_xlabel(time_axis.label)
    axes.set_ylabel(label)
    figure.legend(loc="outside upper left", ncols=3, frameon=False, labelcolor=INK)
