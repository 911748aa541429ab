"""Builds scenarios for the bench, as TOML."""

from __future__ import annotations

import math

_UAV = """
[types.f450]
airframe = "f450"
plant = "{plant}"
[types.f450.flight]
take_off_altitude_m = 2.5
[[types.f450.sensors]]
kind = "odometry"
rate_hz = 30.0
"""
_SPACING_M = 4.0


def crowd(uavs: int) -> str:
    """Returns a scenario of UAVs that hold their positions, in rows."""
    columns = math.isqrt(uavs - 1) + 1
    text = f'name = "crowd_{uavs}"\nduration_s = 1e6\n' + _UAV.format(plant="kinematic")
    for row in range(math.ceil(uavs / columns)):
        count = min(columns, uavs - row * columns)
        y, last = row * _SPACING_M, (count - 1) * _SPACING_M
        text += f"""
[[uavs]]
type = "f450"
count = {count}
position_m = [0.0, {y}]
last_position_m = [{last}, {y}]
on_start = "take_off"
"""
    return text


def forest() -> str:
    """Returns a scenario of one UAV in a forest of 5,000 trees."""
    return (
        'name = "forest"\nduration_s = 1e6\n'
        + _UAV.format(plant="rigid_body")
        + """
[world.forest]
kind = "procedural"
region_m = [0, 0, 500, 500]
trees = 5000
minimum_spacing_m = 2.0
species = { broadleaf = 0.7, conifer = 0.3 }

[[uavs]]
type = "f450"
position_m = [250.0, 250.0]
placement = "nearest_free"
on_start = "take_off"
"""
    )
