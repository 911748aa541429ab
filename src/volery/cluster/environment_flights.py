"""Flies many runs of one parameter point together, as environments of a vectorized simulation."""

from __future__ import annotations

import time
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, Schedule, ns_from_s
from volery.results import FlightResult
from volery.results.drawn_world import DrawnWorld
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.scenario.schema import Scenario
from volery.verdicts.finished_run import FinishedRun

_COLUMNS = {"position_map": 3, "velocity_map": 3, "attitude": 4, "omega_body": 3}
_BATTERY = sum(_COLUMNS.values())
_WIDTH = _BATTERY + 1
_MAX_BYTES = 128e6
"""Memory of the samples of one batch."""


def obstacle(scenario: Scenario) -> str:
    """Returns what keeps the runs of a scenario from being environments; empty: nothing."""
    found = {
        "the scenario has nodes": bool(scenario.node_entries),
        "the scenario has faults": bool(scenario.faults),
        "the scenario has a radio": scenario.radio is not None,
        "the world has actors": bool(scenario.world.actors),
        "each seed makes another world; world.seed would fix it": scenario.has_seeded_world,
        "runs end at different times": scenario.ends_when != "time_is_up",
    }
    return next((reason for reason, applies in found.items() if applies), "")


def max_environments(scenario: Scenario, rate_hz: float) -> int:
    """Returns the number of environments whose samples fit into memory, at least 1."""
    samples = scenario.duration_s * rate_hz + 2.0
    return max(1, int(_MAX_BYTES / (8 * _WIDTH * samples * scenario.uav_count)))


def fly_environments(
    scenario: Scenario, seeds: Sequence[int], rate_hz: float
) -> tuple[VectorizedSimulation, list[FinishedRun]]:
    """Flies one environment for each seed to the end.

    Returns the simulation, which the caller closes after the last use of the runs' scene, and the
    finished runs in the order of the seeds.
    """
    start = time.perf_counter()
    envs = VectorizedSimulation(scenario, len(seeds), seeds=seeds, threads=1)
    try:
        steps = _sampled_steps(scenario, rate_hz, envs.dt_ns)
        rows, modes = _sampled(envs, steps)
        events: list[list[Any]] = [[] for _ in seeds]
        for event in envs.drain_events():
            events[event.env].append(event.event)
        wall_s = (time.perf_counter() - start) / len(seeds)
        world = DrawnWorld(envs.terrain, envs.forest, tuple(s.mesh for s in envs.scene.solids))
        times_s = steps * envs.dt_ns / NS_PER_S
        airframes = dict(zip(envs.uav_names, envs.airframes, strict=True))
        runs = []
        for k, seed in enumerate(seeds):
            flight = FlightResult(
                scenario=scenario.name,
                seed=seed,
                uavs=envs.uav_names,
                times_s=times_s,
                mode=modes[k],
                events=tuple(events[k]),
                world=world,
                **_states(rows[k]),
            )
            own = scenario.model_copy(update={"seed": seed})
            runs.append(FinishedRun(flight, own, airframes, envs.scene, wall_s))
    except BaseException:
        envs.close()
        raise
    return envs, runs


def _sampled_steps(scenario: Scenario, rate_hz: float, dt_ns: int) -> NDArray[np.int64]:
    """Returns the physics steps (T,) of a flight recorder's samples: the first and last, too."""
    last = -(-ns_from_s(scenario.duration_s) // dt_ns)
    schedule = Schedule(Fraction(NS_PER_S, ns_from_s(1.0 / rate_hz)))
    steps = [0]
    k = 1
    while (step := -(-schedule.instant_ns(k) // dt_ns)) < last:
        if step > steps[-1]:
            steps.append(step)
        k += 1
    return np.array([*steps, last], np.int64)


def _sampled(
    envs: VectorizedSimulation, steps: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int8]]:
    """Advances through the steps and returns states (K, n, T, columns) and modes (K, n, T)."""
    shape = (envs.num_envs, len(envs.uav_names), len(steps))
    rows, modes = np.zeros((*shape, _WIDTH)), np.zeros(shape, np.int8)
    done = 0
    for k, step in enumerate(steps.tolist()):
        if step > done:
            envs.step(step - done)
            done = step
        state, first = envs.state(), 0
        for name, width in _COLUMNS.items():
            rows[:, :, k, first : first + width] = getattr(state, name)
            first += width
        rows[:, :, k, _BATTERY] = state.battery_charge
        modes[:, :, k] = envs.modes
    return rows, modes


def _states(rows: Array) -> dict[str, Array]:
    """Returns the arrays of a flight from the samples (n, T, columns) of one environment."""
    first, states = 0, {}
    for name, width in _COLUMNS.items():
        states[name] = np.ascontiguousarray(rows[:, :, first : first + width])
        first += width
    states["battery_charge"] = np.ascontiguousarray(rows[:, :, _BATTERY])
    return states
