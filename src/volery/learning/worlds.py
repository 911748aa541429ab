"""Scenarios of tasks."""

from __future__ import annotations

from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario


def open_air(airframe: str, *, physics_hz: int, guidance_hz: int, num_uavs: int = 1) -> Scenario:
    """Returns a scenario of UAVs without sensors above flat ground, 3 m apart."""
    return parse_scenario(
        {
            "name": f"open_air_{airframe}",
            "physics": {"rate_hz": physics_hz, "guidance_rate_hz": guidance_hz},
            "types": {airframe: {"airframe": airframe, "sensors": []}},
            "uavs": [
                {"type": airframe, "position_m": [0.0, 3.0 * k, 10.0]} for k in range(num_uavs)
            ],
        }
    )
