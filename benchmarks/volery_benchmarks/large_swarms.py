"""Measures how many flocking UAVs fly in real time, in full physics.

F450s with contacts and downwash at 1 kHz on all threads, 6 m apart at first, flock in an arena as
in G. Vasarhelyi et al. (Science Robotics, 2018), twenty commands a second.
"""

from __future__ import annotations

import math
import statistics
import time
from typing import Any

import numpy as np

from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.vasarhelyi import Vasarhelyi
from volery.core.machine import usable_cores
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario

_APART_M, _HEIGHT_M, _SPEED_M_S = 6.0, 10.0, 3.0
_PERIOD_S, _ROUND_S, _ROUNDS = 0.05, 2.0, 5
_STEP = 1000
_MAX_UAVS = 16_000


def measure_real_time(quick: bool) -> dict[str, float]:
    """Returns the factor of 1,000 UAVs, and the largest number that flies in real time.

    The number is interpolated between thousands.
    """
    factor = real_time_factor(_STEP)
    figures = {"swarm_1000_realtime_factor": factor}
    if quick:
        return figures
    count, before = _STEP, math.inf
    while factor >= 1.0 and count < _MAX_UAVS:
        count, before = count + _STEP, factor
        factor = real_time_factor(count)
    part = (before - 1.0) / (before - factor) if factor < 1.0 < before < math.inf else 1.0
    return {**figures, "realtime_uavs_state": count - _STEP + part * _STEP}


def real_time_factor(count: int) -> float:
    """Returns the median factor of a flock over a few rounds, after a first one."""
    side = math.ceil(math.sqrt(count))
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)[:count]
    start = _APART_M * (grid - grid.mean(axis=0))
    half_width_m = float(np.abs(start).max()) + 30.0
    around = Surroundings(
        arena=np.array([-half_width_m, -half_width_m, half_width_m, half_width_m])
    )
    behaviour = Vasarhelyi()
    preferred = _SPEED_M_S * np.stack(
        [np.cos(angle := np.arange(count) * 2.399), np.sin(angle)], axis=1
    )
    factors = []
    with VectorizedSimulation(
        parse_scenario(_scenario(start, half_width_m), where="bench"), 1, threads=usable_cores()
    ) as envs:
        for number in range(_ROUNDS + 1):
            begun = time.perf_counter()
            for _ in range(round(_ROUND_S / _PERIOD_S)):
                state = envs.state()
                flock = flock_within(
                    np.ascontiguousarray(state.position_map[0, :, :2]),
                    np.ascontiguousarray(state.velocity_map[0, :, :2]),
                    behaviour.radius_m,
                )
                level = behaviour.velocities(flock, preferred, around)
                climb = _HEIGHT_M - state.position_map[0, :, 2:]
                envs.command_velocity_map(np.concatenate([level, climb], axis=1)[None])
                envs.run(_PERIOD_S)
            if number:
                factors.append(_ROUND_S / (time.perf_counter() - begun))
    return statistics.median(factors)


def _scenario(start: Any, half_width_m: float) -> dict[str, Any]:
    return {
        "name": "large_swarm",
        "world": {"terrain": {"kind": "flat", "extent_m": 4.0 * half_width_m}},
        "types": {"bird": {"airframe": "f450"}},
        "uavs": [{"type": "bird", "position_m": [float(x), float(y), _HEIGHT_M]} for x, y in start],
    }
