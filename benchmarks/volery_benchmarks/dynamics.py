"""Measures plant and control without sensors: the fused step, swarms, many environments.

Calls are as long as the engine's: five steps between two IMU samples for one UAV, including
Python's share of the call; longer ones for a thousand UAVs, where Python's share is negligible.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.vehicle.airframe import load_airframe
from volery.world.terrain import Terrain
from volery_benchmarks import many_uavs

_SLICE = 5
_ROUNDS = 15


def measure() -> dict[str, float]:
    """Returns medians: ns per drone-step at N = 1000, us per step at N = 1; see `many_uavs`."""
    many, one = _fleet(1000), _fleet(1)
    terrain = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0)).grid
    for fleet in (many, one):
        fleet.advance(200, terrain)
    large, small = [], []
    for _ in range(_ROUNDS):
        start = time.perf_counter()
        many.advance(50, terrain)
        large.append((time.perf_counter() - start) / (50 * len(many)))
        start = time.perf_counter()
        for _ in range(400):
            one.advance(_SLICE, terrain)
        small.append((time.perf_counter() - start) / (400 * _SLICE))
    return {
        "ns_per_drone_step_n1000": 1e9 * statistics.median(large),
        "us_per_step_n1": 1e6 * statistics.median(small),
        "realtime_factor_100_drones": many_uavs.real_time_factor_of_swarm(),
        "steps_per_s_1024_copies": many_uavs.steps_a_second_of_copies(),
    }


def _fleet(count: int) -> Fleet:
    """Returns UAVs on the way to goals 20 m away, so that every control layer is active."""
    side = np.arange(count)
    positions = np.column_stack([2.0 * (side % 40), 2.0 * (side // 40), np.full(count, 30.0)])
    attitude = rotations.from_rpy(np.zeros(count), 0.0, 0.01 * side)
    fleet = Fleet([load_airframe("f450")] * count, positions, attitude)
    for i in range(count):
        fleet.command_position(i, positions[i] + [20.0, 0.0, 5.0], yaw=0.5)
    return fleet
