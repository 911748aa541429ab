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

    from volery.results import FlightResult
    from volery.runtime.vehicles.uav import Uav
    from volery.scenario.schema import Scenario

_ROWS = 12
"""UAVs in the table; more are counted."""


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
