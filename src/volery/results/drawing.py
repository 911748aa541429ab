"""Draws results of flights: maps and lines over time, with matplotlib."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from volery.core.errors import VoleryError
from volery.core.plurals import counted
from volery.figures.flight_data import FlightData, Ground, UavTrack, drawn_event
from volery.results.flight_result import FlightResult, quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARGIN_M = 20.0
"""Width of the plain ground around paths without a world."""
_LEGEND_LIMIT = 12
_MAP_WIDTH_PX = 640


def flight_png(result: FlightResult) -> bytes:
    """Returns the paths from above, over the world, as PNG."""
    from volery.figures.maps import top_view

    return top_view(_flight_data(result))


def flight_html(result: FlightResult) -> str:
    """Returns a line of text and the map as HTML."""
    text = (
        f"<b>{escape(result.scenario)}</b>, seed {result.seed}: "
        f"{counted(len(result), 'UAV')}, {result.duration_s:g} s, "
        f"{counted(len(result.contacts), 'contact')}"
    )
    return f"<div>{text}</div>{png_html(flight_png(result))}"


def png_html(png: bytes) -> str:
    """Returns an `<img>` that holds a PNG."""
    data = base64.b64encode(png).decode("ascii")
    return f'<img width="{_MAP_WIDTH_PX}" alt="map" src="data:image/png;base64,{data}">'


def draw_flight(result: FlightResult, axes: Axes | None) -> Axes:
    """Draws the paths from above, over the world."""
    from volery.figures.maps import draw_top_view

    axes = new_axes() if axes is None else axes
    draw_top_view(axes, _flight_data(result))
    return axes


def draw_over_time(result: FlightResult, quantity: str, axes: Axes | None) -> Axes:
    """Draws a quantity of each UAV over time."""
    known = quantities(result)
    if quantity not in known:
        raise VoleryError(f"cannot draw '{quantity}' over time: use {', '.join(known)}")
    values, label = known[quantity]
    axes = new_axes() if axes is None else axes
    for name, line in zip(result.uavs, values, strict=True):
        axes.plot(result.times_s, line, label=name)
    axes.set_xlabel("simulated time, s")
    axes.set_ylabel(label)
    if len(result) <= _LEGEND_LIMIT:
        axes.legend()
    return axes


def new_axes() -> Axes:
    """Returns the axes of a new figure of pyplot, which notebooks and `pyplot.show()` show."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def _flight_data(result: FlightResult) -> FlightData:
    world = result.world
    tracks = []
    for row, name in enumerate(result.uavs):
        exists = np.isfinite(result.position_map[row]).all(axis=1)
        position = result.position_map[row][exists]
        unknown = np.full(len(position), np.nan)
        speed = result.speed_m_s[row][exists]
        tracks.append(UavTrack(name, result.times_s[exists], position, speed, unknown, unknown))
    return FlightData(
        scenario=result.scenario,
        description="",
        seed=result.seed,
        simulated_s=result.duration_s,
        planned_s=result.duration_s,
        wall_s=0.0,
        uavs=tuple(tracks),
        ground=_plain_ground(tracks) if world is None else world.ground,
        trees=None if world is None else world.trees,
        structures=None if world is None else world.structures,
        events=tuple(drawn_event(event) for event in result.events),
    )


def _plain_ground(tracks: list[UavTrack]) -> Ground:
    """Returns level ground around the paths."""
    places = [track.position_map[:, :2] for track in tracks if len(track.position_map)]
    flown = np.concatenate(places) if places else np.zeros((1, 2))
    low = flown.min(axis=0) - _MARGIN_M
    spacing = float((flown.max(axis=0) - low).max() + _MARGIN_M)
    return Ground(np.zeros((2, 2)), (float(low[0]), float(low[1])), spacing)
