"""The largest fleet that flies in real time, each UAV with two scanning LIDARs.

The UAVs circle slowly in free places of a forest like that of the main job (same species, 5,000
trees in 500 m x 500 m), 3 m above ground: two 1081-beam LIDARs at 40 Hz with noise and sweep
distortion, IMU at 200 Hz, 1 kHz physics and control, every LaserScan message built.
"""

from __future__ import annotations

import statistics
import time

from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

_SECONDS = 2.0
_REPEATS = 3
_ROWS = 10
_FIRST_GUESS = 60
_STEP = 5


def measure() -> dict[str, float]:
    """Figures of the bench `fleet`."""
    at_sixty = real_time_factor(_FIRST_GUESS)
    # Wall time grows in proportion to the fleet; start there and step down to what holds.
    uavs = max(_STEP, round(_FIRST_GUESS * at_sixty / _STEP) * _STEP + _STEP)
    factor = real_time_factor(uavs)
    while factor < 1.0 and uavs > _STEP:
        uavs -= _STEP
        factor = real_time_factor(uavs)
    return {
        "realtime_uavs": float(uavs),
        "real_time_factor_there": factor,
        "real_time_factor_60_uavs": at_sixty,
    }


def real_time_factor(uavs: int) -> float:
    """Median real-time factor of a fleet of `uavs`."""
    with Simulation(parse_scenario(_scenario(uavs), where="bench fleet")) as simulation:
        received = 0

        def count(_message: object) -> None:
            nonlocal received
            received += 1

        for topic in simulation.mounts:
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
        expected = 2 * 40 * uavs * _SECONDS * _REPEATS
        if abs(received - expected) > 4 * uavs:
            raise AssertionError(f"{received} scans instead of {expected:.0f}")
        return statistics.median(factors)


def _scenario(uavs: int) -> dict[str, object]:
    sensors = [
        {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
        {"kind": "lidar", "name": "nodding", "position_m": [0.1, 0.0, -0.08], "nodding": {}},
        {"kind": "imu"},
    ]
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
                "sensors": sensors,
                "flight": {"take_off_altitude_m": 3.0, "command_timeout_s": 60.0},
            }
        },
        "uavs": groups,
    }
