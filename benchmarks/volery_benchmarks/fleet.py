"""Measures the largest fleets that fly in real time, with scanning LIDARs and their messages.

The UAVs circle slowly at free positions of a forest like that of the main job (same species, 5,000
trees in 500 m x 500 m), 3 m above ground; IMU at 200 Hz, 1 kHz physics and control, LIDARs with
noise and sweep distortion, every message built. `realtime_uavs` has two planar LIDARs per UAV, 1081
beams at 40 Hz each; `realtime_uavs_64_rings` has a LIDAR with 64 rings of 1024 beams at 10 Hz
instead.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

_SECONDS = 2.0
_REPEATS = 3
_ROWS = 10
_PLANAR: list[dict[str, Any]] = [
    {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
    {"kind": "lidar", "name": "nodding", "position_m": [0.1, 0.0, -0.08], "nodding": {}},
]
_RINGS: list[dict[str, Any]] = [
    {"kind": "lidar", "name": "top", "model": "os1_64", "position_m": [0.0, 0.0, 0.18]}
]


def measure() -> dict[str, float]:
    """Returns the figures of the bench `fleet`."""
    at_sixty = real_time_factor(60)
    uavs, factor = largest(real_time_factor, first=round(60 * at_sixty), step=5)
    rings, rings_factor = largest(lambda n: real_time_factor(n, rings=True), first=8, step=1)
    return {
        "realtime_uavs": float(uavs),
        "real_time_factor_there": factor,
        "real_time_factor_60_uavs": at_sixty,
        "realtime_uavs_64_rings": float(rings),
        "real_time_factor_there_64_rings": rings_factor,
    }


def largest(factor_of: Callable[[int], float], *, first: int, step: int) -> tuple[int, float]:
    """Returns the largest multiple of `step` with a factor of at least 1, and the factor.

    Returns (0, 0) if there is none. Wall time is roughly proportional to the fleet, so each
    measurement suggests the next fleet; the search ends between a fleet that holds and the next
    one, which fails.
    """
    holds, held, fails = 0, 0.0, 1 << 30
    uavs = max(step, first // step * step)
    while fails - holds > step:
        factor = factor_of(uavs)
        if factor >= 1.0:
            holds, held = uavs, factor
        else:
            fails = uavs
        aim = int(uavs * factor) // step * step
        uavs = min(max(aim, holds + step), fails - step)
    return holds, held


def real_time_factor(uavs: int, *, rings: bool = False) -> float:
    """Returns the median real-time factor of a fleet with two planar LIDARs or one of 64 rings."""
    scenario = parse_scenario(
        fleet_scenario(uavs, _RINGS if rings else _PLANAR), where="bench fleet"
    )
    with Simulation(scenario) as simulation:
        received = 0

        def count(_message: object) -> None:
            nonlocal received
            received += 1

        for topic in (*simulation.vehicles.lidar_mounts, *simulation.vehicles.point_cloud_mounts):
            simulation.graph.subscribe(topic, count)
        simulation.run(2.5)  # climb
        for uav in simulation.uavs.values():
            uav.command_velocity([0.3, 0.0, 0.0], 0.5)
        simulation.run(0.5)
        received = 0
        factors = []
        for _ in range(_REPEATS):
            before = time.perf_counter()
            simulation.run(_SECONDS)
            factors.append(_SECONDS / (time.perf_counter() - before))
        expected = (10 if rings else 2 * 40) * uavs * _SECONDS * _REPEATS
        if abs(received - expected) > 4 * uavs:
            raise AssertionError(f"{received} scans instead of {expected:.0f}")
        return statistics.median(factors)


def fleet_scenario(uavs: int, sensors: list[dict[str, Any]]) -> dict[str, object]:
    """Returns a scenario of UAVs with `sensors` and an IMU at free positions of the forest."""
    rows = min(_ROWS, uavs)
    groups = [
        {
            "type": "surveyor",
            "count": uavs // rows + (row < uavs % rows),
            "position_m": [40.0, 40.0 + 42.0 * row],
            "last_position_m": [460.0, 40.0 + 42.0 * row],
            "placement": "nearest_free",
            "on_start": "take_off",
        }
        for row in range(rows)
    ]
    return {
        "name": "bench_fleet",
        "duration_s": 1000.0,
        "world": {
            "forest": {
                "kind": "procedural",
                "region_m": [0.0, 0.0, 500.0, 500.0],
                "trees": 5000,
                "minimum_spacing_m": 1.0,
                "species": {"beilschmiedia_pendula": 1.0},
            }
        },
        "types": {
            "surveyor": {
                "sensors": [*sensors, {"kind": "imu"}],
                "flight": {"take_off_altitude_m": 3.0, "command_timeout_s": 60.0},
            }
        },
        "uavs": groups,
    }
