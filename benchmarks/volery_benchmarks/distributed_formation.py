"""Measures formations without a leader: birds that plan for themselves, and flights by radio."""

from __future__ import annotations

import math
import time

import numpy as np

from volery.autonomy.swarm.formation_fitness import fitness_cost, formation_fitness
from volery.autonomy.swarm.formation_member import REPORT
from volery.autonomy.swarm.member_planning import MemberPlanner
from volery.autonomy.swarm.particle_swarm import FlockLimits
from volery.core.arrays import Array
from volery.graph.messages import message_type
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery_benchmarks.formation_flight import FormationFlight

_STEPS = 150
_SOLVED = 1e-3
"""Cost of a V, as for plans of the whole flock."""
_LIMITS = FlockLimits(min_distance=1.0, max_speed=2.67, max_acceleration=1.33)
"""Those of the node's defaults, in wing spans and steps."""
_TAKE_OFF_S, _FORM_S, _RECOVER_S = 60.0, 240.0, 120.0
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
    rng = np.random.default_rng(seed)
    with Simulation(scenario) as simulation:
        watch = _Watch(simulation)
        simulation.run_until(lambda: watch.has_reports, _TAKE_OFF_S)
        start, wall = simulation.time_s, time.perf_counter()
        time_to_v = watch.wait_for_v(_FORM_S) - start
        factor = (simulation.time_s - start) / (time.perf_counter() - wall)
        begun = simulation.time_s
        for name in rng.choice(sorted(simulation.uavs), lost, replace=False):
            simulation.uavs[name].land()
            watch.names.remove(str(name))
        again = watch.wait_for_v(_RECOVER_S) if time_to_v > 0.0 else math.nan
        return FormationFlight(time_to_v, again - begun, watch.min_distance_m, factor)


class _Watch:
    """Follows the true formation of UAVs, and the distances between those in the air."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.names = sorted(simulation.uavs)
        """UAVs that are to be in the formation."""
        self.min_distance_m = math.inf
        self.has_reports = False
        topic = f"/{self.names[0]}/team"
        simulation.graph.subscribe(topic, self._on_report, message_type(REPORT))

    def _on_report(self, _published: object) -> None:
        self.has_reports = True

    def wait_for_v(self, timeout_s: float) -> float:
        """Returns the time of the next V, s; NaN if there is none until the timeout."""
        until = self._simulation.time_s + timeout_s
        while self._simulation.time_s < until:
            self._simulation.run(_WATCH_S)
            if self._look() < _LOST:
                return self._simulation.time_s
        return math.nan

    def _look(self) -> float:
        """Returns the cost of the present formation."""
        vehicles = self._simulation.vehicles.state()
        in_air = vehicles.position_map[~vehicles.crashed]
        apart = np.linalg.norm(in_air[:, None] - in_air, axis=2)
        apart[np.diag_indices(len(apart))] = math.inf
        self.min_distance_m = min(self.min_distance_m, float(apart.min(initial=math.inf)))
        rows = [self._simulation.vehicles.names.index(name) for name in self.names]
        position, velocity = vehicles.position_map[rows, :2], vehicles.velocity_map[rows, :2]
        return formation_fitness(position / _SPAN_M, velocity * _STEP_S / _SPAN_M).cost
