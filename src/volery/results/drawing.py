"""Draws results of flights: maps and lines over time, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.core.plurals import counted
from volery.figures.flight_data import FlightData, Ground, UavTrack, drawn_event
from volery.figures.notebook import new_axes, png_html
from volery.results.flight_states import FlightStates

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARGIN_M = 20.0
"""Width of the plain ground around paths without a world."""
_LEGEND_LIMIT = 12


def flight_png(result: FlightStates) -> bytes:
    """Returns the paths from above, over the world, as PNG."""
    from volery.figures.maps import top_view

    return top_view(_flight_data(result))


def flight_html(result: FlightStates) -> str:
    """Returns a line of text and the map as HTML."""
    text = (
        f"<b>{escape(result.scenario)}</b>, seed {result.seed}: "
        f"{counted(len(result), 'UAV')}, {result.duration_s:g} s, "
        f"{counted(len(result.contacts), 'contact')}"
    )
    return f"<div>{text}</div>{png_html(flight_png(result))}"


def draw_flight(result: FlightStates, axes: Axes | None) -> Axes:
    """Draws the paths from above, over the world."""
    from volery.figures.maps import draw_top_view

    axes = new_axes() if axes is None else axes
    draw_top_view(axes, _flight_data(result))
    return axes


def draw_over_time(result: FlightStates, quantity: str, axes: Axes | None) -> Axes:
    """Draws a quantity of each UAV over time."""
    known = _quantities(result)
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


def _flight_data(result: FlightStates) -> FlightData:
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
    positions = [track.position_map[:, :2] for track in tracks if len(track.position_map)]
    flown = np.concatenate(positions) if positions else np.zeros((1, 2))
    low = flown.min(axis=0) - _MARGIN_M
    spacing = float((flown.max(axis=0) - low).max() + _MARGIN_M)
    return Ground(np.zeros((2, 2)), (float(low[0]), float(low[1])), spacing)


def _quantities(result: FlightStates) -> Mapping[str, tuple[Array, str]]:
    """Returns the quantities (n, T) that can be drawn over time, each with its label."""
    return {
        "height": (result.position_map[:, :, 2], "height (z), m"),
        "x": (result.position_map[:, :, 0], "x, m"),
        "y": (result.position_map[:, :, 1], "y, m"),
        "speed": (result.speed_m_s, "speed, m/s"),
        "battery": (result.battery_charge, "battery charge"),
    }
