"""Measures whole swarms and many environments, with contacts, downwash and events.

The scenario `swarm_100` flies 100 Crazyflies in two tiers back and forth by position commands, with
physics and position control at 500 Hz. The environments are 1,024 times one Crazyflie under
velocity commands, ten a second, at 1 kHz physics, on two threads.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from volery.runtime import Simulation, VectorizedSimulation
from volery.scenario.load import load_scenario, parse_scenario

_ROUNDS = 5
_SWARM_S = 10.0
_COPIES = 1024
_COPIES_S = 1.0
_LONE = {
    "name": "lone_crazyflie",
    "types": {"crazyflie": {"airframe": "crazyflie"}},
    "uavs": [{"type": "crazyflie", "position_m": [0.0, 0.0, 20.0]}],
}


def real_time_factor_of_swarm() -> float:
    """Returns the median real-time factor of `swarm_100` over a few rounds."""
    factors = []
    with Simulation(load_scenario("swarm_100"), threads=1) as simulation:
        homes = {name: uav.position_map for name, uav in simulation.uavs.items()}
        simulation.run(1.0)
        for k in range(_ROUNDS):
            start = time.perf_counter()
            for half in (0, 1):
                step = np.array([0.4, 0.3, 0.2]) * (1 if half == 0 else -1) * (-1) ** k
                for name, uav in simulation.uavs.items():
                    uav.go_to(homes[name] + step)
                simulation.run(_SWARM_S / 2.0)
            factors.append(_SWARM_S / (time.perf_counter() - start))
    return statistics.median(factors)


def steps_a_second_of_copies(threads: int = 2) -> float:
    """Returns the median of all environments' physics steps per second of wall time."""
    rng = np.random.default_rng(1)
    rates = []
    with VectorizedSimulation(parse_scenario(_LONE), _COPIES, threads=threads) as envs:
        envs.run(0.1)
        for _ in range(_ROUNDS):
            start = time.perf_counter()
            for _ in range(round(_COPIES_S / 0.1)):
                envs.command_velocity(rng.uniform(-1.0, 1.0, (_COPIES, 1, 3)))
                envs.run(0.1)
            rates.append(_COPIES * _COPIES_S * 1000.0 / (time.perf_counter() - start))
    return statistics.median(rates)
