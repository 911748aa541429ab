"""Shows a simulation in a notebook: its time, its UAVs, and a map with the recorded paths."""

from __future__ import annotations

from html import escape
from itertools import islice
from typing import TYPE_CHECKING

from volery.core.plurals import counted
from volery.figures.notebook import png_html
from volery.results.drawing import flight_png

if TYPE_CHECKING:
    from collections.abc import Collection

    from volery.core.arrays import Array
    from volery.results import FlightResult
    from volery.runtime.vehicles.uav import Uav
    from volery.scenario.schema import Scenario

_ROWS = 12
"""UAVs in the table; more are counted."""


def uav_html(uav: Uav) -> str:
    """Returns the present state of a UAV and the names of its sensors as HTML."""
    if uav.is_deleted:
        return f"<div>{escape(repr(uav))}</div>"
    rows = {
        "flight mode": uav.mode.name,
        "command": uav.pending_command.command if uav.pending_command else "none",
        "position (map), m": _vector(uav.position_map),
        "velocity (map), m/s": _vector(uav.velocity_map),
        "battery": f"{100.0 * uav.battery_charge:.0f} %",
        "sensors": ", ".join(uav.sensors) or "none",
    }
    cells = "".join(f"<tr><th>{k}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
    kind = escape(f"{uav.type_name}, {uav.airframe.title}" if uav.type_name else "")
    return f"<div><b>{escape(uav.name)}</b> {kind}</div><table>{cells}</table>"


def _vector(values: Array) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def simulation_html(
    scenario: Scenario, time_s: float, uavs: Collection[Uav], flight: FlightResult
) -> str:
    """Returns the state of a simulation and a map with the paths of `flight` as HTML."""
    rows = []
    for uav in islice(uavs, _ROWS):
        x, y, z = uav.position_map
        rows.append(
            f"<tr><td>{escape(uav.name)}</td><td>{uav.mode.name}</td>"
            f"<td>{x:.2f}, {y:.2f}, {z:.2f}</td></tr>"
        )
    more = f"<div>and {len(uavs) - _ROWS} more</div>" if len(uavs) > _ROWS else ""
    return (
        f"<div><b>{escape(scenario.name)}</b>, seed {flight.seed}: "
        f"{time_s:.3f} of {scenario.duration_s:g} s, {counted(len(uavs), 'UAV')}</div>"
        "<table><tr><th>UAV</th><th>mode</th><th>position (map), m</th></tr>"
        f"{''.join(rows)}</table>{more}{png_html(flight_png(flight))}"
    )
