"""Line and bar charts as SVG, in the reader's light or dark colours.

It uses matplotlib's object interface only: no global state, nothing to close.
"""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.figures.flight_data import FlightData, UavTrack
from volery.figures.palette import CSS_NAMES, FAINT, GRID, INK, UAV_COLORS, uav_color

_LEGEND_LIMIT = len(UAV_COLORS)
_POINTS = 1200
"""Max points of a line; a chart is about half as many pixels wide."""
_WIDTH, _HEIGHT = 5.6, 2.9


def height_chart(flight: FlightData) -> str:
    """Draws the height above ground over time."""
    return _over_time(flight, lambda uav: uav.height_m, "height above ground, m", floor=0.0)


def speed_chart(flight: FlightData) -> str:
    """Draws the speed over time."""
    return _over_time(flight, lambda uav: uav.speed_m_s, "speed, m/s", floor=0.0)


def clearance_chart(flight: FlightData) -> str:
    """Draws the distance to the nearest tree or solid over time, up to the searched range."""
    max_clearance_m = flight.max_clearance_m
    return _over_time(
        flight,
        lambda uav: np.minimum(uav.clearance_m, max_clearance_m),
        "distance to the nearest obstacle, m",
        floor=0.0,
        ceiling=max_clearance_m * 1.03,
        lowest=True,
    )


def load_chart(flight: FlightData) -> str:
    """Draws each stage's fraction of the computing time, and of real time."""
    stages = sorted(flight.stage_seconds.items(), key=lambda pair: pair[1])
    names = [name.replace("_", " ") for name, _ in stages]
    seconds = np.array([value for _, value in stages])
    total = max(flight.wall_s, float(seconds.sum()), 1e-9)
    figure, axes = new_axes(height=max(1.0 + 0.3 * len(stages), 2.0))
    bars = axes.barh(names, seconds / total * 100.0, height=0.62, color=UAV_COLORS[0])
    for bar, value in zip(bars, seconds, strict=True):
        load = value / flight.simulated_s if flight.simulated_s > 0.0 else 0.0
        axes.annotate(
            f"{load * 100.0:.1f} % of real time",
            (bar.get_width(), bar.get_y() + bar.get_height() / 2.0),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            color=INK,
            fontsize=9,
        )
    axes.set_xlim(0.0, float(seconds.max(initial=1e-9)) / total * 100.0 * 1.5)
    axes.set_xlabel("fraction of the wall time, %")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    return as_svg(figure)


def _over_time(
    flight: FlightData,
    values: Callable[[UavTrack], Array],
    label: str,
    *,
    floor: float | None = None,
    ceiling: float | None = None,
    lowest: bool = False,
) -> str:
    figure, axes = new_axes()
    many = len(flight.uavs) > _LEGEND_LIMIT
    for number, uav in enumerate(flight.uavs):
        keep = thinned(values(uav), lowest=lowest)
        axes.plot(
            uav.time_s[keep],
            values(uav)[keep],
            color=uav_color(number),
            linewidth=0.9 if many else 1.5,
            alpha=0.6 if many else 0.95,
            label=uav.name,
            solid_joinstyle="round",
        )
    end = max((float(u.time_s[-1]) for u in flight.uavs if len(u.time_s)), default=1.0)
    axes.set_xlim(0.0, max(end, 1e-3))
    axes.set_ylim(floor, ceiling)
    axes.set_xlabel("simulated time, s")
    axes.set_ylabel(label)
    for event in flight.events:
        if event.is_contact:
            axes.axvline(event.time_s, color="#e03131", linewidth=1.0, linestyle=(0, (3, 2)))
    if flight.uavs and not many:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(-0.01, 1.0),
            ncols=_LEGEND_LIMIT,
            frameon=False,
            handlelength=1.2,
            columnspacing=1.4,
            labelcolor=INK,
            borderaxespad=0.1,
        )
    return as_svg(figure)


def thinned(values: Array, *, lowest: bool) -> NDArray[np.int64]:
    """Returns indices to draw: evenly spread, or the lowest value of every stretch."""
    if len(values) <= _POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), _POINTS + 1).astype(np.int64)
    if not lowest:
        return np.append(edges[:-1], len(values) - 1)
    return np.array([a + int(np.argmin(values[a:b])) for a, b in pairwise(edges)])


def new_axes(width: float = _WIDTH, height: float = _HEIGHT) -> tuple[Figure, Axes]:
    """Returns a figure, in inches, with axes in the style of the report."""
    figure, (axes,) = new_panels(1, width, height)
    return figure, axes


def new_panels(
    count: int, width: float, height: float, columns: int = 1
) -> tuple[Figure, list[Axes]]:
    """Returns a figure, in inches, with axes of one scale, row by row, in the report's style."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.patch.set_alpha(0.0)
    rows = -(-count // columns)
    panels: list[Axes] = []
    for number in range(count):
        shared = panels[0] if panels else None
        panels.append(figure.add_subplot(rows, columns, number + 1, sharex=shared, sharey=shared))
        _apply_style(panels[-1])
    return figure, panels


def _apply_style(axes: Axes) -> None:
    axes.patch.set_alpha(0.0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(FAINT)
    axes.tick_params(colors=FAINT, labelsize=9, length=3)
    axes.tick_params(axis="y", length=0)
    axes.xaxis.label.set_color(FAINT)
    axes.yaxis.label.set_color(FAINT)
    axes.grid(visible=True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)


def as_svg(figure: Figure) -> str:
    """Returns the drawing as an inline <svg> that scales with the page and uses its style."""
    file = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "volery"}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    text = file.getvalue()
    text = text[text.index("<svg") :]
    for stand_in, name in CSS_NAMES.items():
        text = text.replace(stand_in, name)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"font: (\d+(?:\.\d+)?)px [^;\"]*", r"font-size: \1px", text)
    # one page holds several drawings: their ids must be unique
    prefix = f"c{zlib.crc32(text.encode()):08x}"
    text = re.sub(r'id="([^"]+)"', rf'id="{prefix}\1"', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{prefix}", text)
    width_height = re.compile(r'(<svg[^>]*?) width="[^"]*"|(<svg[^>]*?) height="[^"]*"')
    for _ in range(2):
        text = width_height.sub(lambda m: m.group(1) or m.group(2), text, count=1)
    return text
