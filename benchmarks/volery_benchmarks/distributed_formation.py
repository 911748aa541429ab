"""Measures formations without a leader: birds that plan for themselves, and flights by radio."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from volery.autonomy.swarm.formation_fitness import fitness_cost, formation_fitness
from volery.autonomy.swarm.formation_member import REPORT
from volery.autonomy.swarm.member_planning import MemberPlanner
from volery.autonomy.swarm.particle_swarm import FlockLimits
from volery.core.arrays import Array
from volery.graph.messages import message_type
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery_benchmarks.formation_flight import FormationFlight, fly_scenario, least_distance_m

_STEPS = 150
_SOLVED = 1e-3
"""Cost of a V, as for plans of the whole flock."""
_LIMITS = FlockLimits(min_distance=1.0, max_speed=2.67, max_acceleration=1.33)
"""Those of the node's defaults, in wing spans and steps."""
_SPAN_M, _STEP_S, _LOST = 3.0, 2.0, 0.1
_WATCH_S = 0.5


def plan(positions: Array, velocities: Array, seed: int) -> tuple[int | None, float]:
    """Returns the steps until a flock (N, 2) that plans in turn is in a V, and its CPU time, s.

    None: it is in none after 150 steps.
    """
    began = time.thread_time()
    flock = np.concatenate((positions.T, velocities.T))
    birds = [MemberPlanner(_LIMITS, seed=1000 * seed + k) for k in range(len(positions))]
    for row, bird in enumerate(birds):
        bird.begin(flock, row)
    for step in range(1, _STEPS + 1):
        joining = np.array([bird.is_joining for bird in birds])
        for row, bird in enumerate(birds):
            flock[2:, row] = bird.velocity(flock, joining, row)
            joining[row] = bird.is_joining
        flock[:2] += flock[2:]
        if fitness_cost(flock) < _SOLVED:
            return step, time.thread_time() - began
    return None, time.thread_time() - began


def fly(seed: int, uavs: int, lost: int) -> FormationFlight:
    """Flies the scenario into a V, lands `lost` UAVs, and flies until the V of the others."""
    width_m = 10.0 * (uavs - 1)
    changes = {
        "types.bird.nodes[0].parameters.seed": seed,
        "types.bird.nodes[0].parameters.start_m": [100.0 + 0.5 * width_m, 100.0],
        "uavs[0].last_position_m": [100.0 + width_m, 100.0],
    }
    scenario = load_scenario("v_formation_distributed").with_(
        changes, uavs=uavs, seed=seed, duration_s=1e4
    )
    return fly_scenario(scenario, _TrueWatch, lost)


class _TrueWatch:
    """Follows the true formation; the first report of a UAV ends the take-off."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.min_distance_m = math.inf
        self.has_begun = False
        topic = f"/{simulation.vehicles.names[0]}/team"
        simulation.graph.subscribe(topic, self._on_report, message_type(REPORT))

    def _on_report(self, _published: object) -> None:
        self.has_begun = True

    def wait_for_v(self, timeout_s: float, lost: Sequence[str] = ()) -> float:
        """See `FormationWatch`."""
        simulation = self._simulation
        rows = [k for k, name in enumerate(simulation.vehicles.names) if name not in lost]
        until = simulation.time_s + timeout_s
        while simulation.time_s < until:
            simulation.run(_WATCH_S)
            self.min_distance_m = min(self.min_distance_m, least_distance_m(simulation))
            state = simulation.vehicles.state()
            position, velocity = state.position_map[rows, :2], state.velocity_map[rows, :2]
            cost = formation_fitness(position / _SPAN_M, velocity * _STEP_S / _SPAN_M).cost
            if cost < _LOST:
                return simulation.time_s
        return math.nan
