"""Compiles every kernel once, so that parallel test workers and first runs find them cached.

    python -m volery.runtime.warm_up
"""

from __future__ import annotations

from volery.runtime.simulation import Simulation
from volery.scenario.load import parse_scenario

_EVERYTHING = {
    "name": "warm_up",
    "types": {
        "all": {
            "sensors": [
                {"kind": "lidar", "name": "nodding", "nodding": {}},
                {"kind": "imu"},
                {"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]},
                {"kind": "odometry"},
                {"kind": "ground_truth"},
            ]
        }
    },
    "uavs": [
        {
            "type": "all",
            "count": 2,
            "position_m": [0.0, 0.0],
            "last_position_m": [3.0, 0.0],
            "on_start": "take_off",
        }
    ],
}


def warm_up() -> None:
    """Fly two UAVs with every kind of sensor for a tenth of a second."""
    with Simulation(parse_scenario(_EVERYTHING, where="warm-up"), threads=1) as simulation:
        simulation.run(0.1)


if __name__ == "__main__":
    warm_up()
