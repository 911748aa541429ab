"""Flights into a V without a leader, in full physics and over the simulated radio."""

from __future__ import annotations

import numpy as np
import pytest

from volery.autonomy.swarm.formation_fitness import formation_fitness
from volery.core.errors import VoleryError
from volery.engine.events import EventKind
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

CONTACTS = {EventKind.COLLISION, EventKind.IMPACT}


def scenario(uavs: int = 5):
    width_m = 10.0 * (uavs - 1)
    changes = {
        "uavs[0].last_position_m": [100.0 + width_m, 100.0],
        "types.bird.nodes[0].parameters.start_m": [100.0 + 0.5 * width_m, 100.0],
    }
    return load_scenario("v_formation_distributed").with_(changes, uavs=uavs, duration_s=1e4)


def true_cost(simulation: Simulation, names: list[str]) -> float:
    """Cost of the formation in which UAVs fly, by ground truth."""
    uavs = [simulation.uavs[name] for name in names]
    position = np.array([uav.position_map[:2] for uav in uavs]) / 3.0
    velocity = np.array([uav.velocity_map[:2] for uav in uavs]) * 2.0 / 3.0
    return formation_fitness(position, velocity).cost


def test_a_team_forms_a_v_and_forms_it_anew_when_one_lands() -> None:
    with Simulation(scenario()) as simulation:
        names = sorted(simulation.uavs)
        simulation.run(30.0)
        simulation.run_until(lambda: true_cost(simulation, names) < 0.05, 200.0)
        simulation.uavs["uav2"].land()
        rest = [name for name in names if name != "uav2"]
        simulation.run_until(lambda: true_cost(simulation, rest) < 0.05, 120.0)
        assert not [e for e in simulation.diagnostics.events if e.kind in CONTACTS]


def test_threads_and_snapshots_change_no_byte() -> None:
    digests = []
    for threads in (1, 2):
        with Simulation(scenario(), threads=threads) as simulation:
            simulation.diagnostics.enable_digest()
            simulation.run(26.0)
            kept = simulation.snapshot()
            simulation.run(8.0)
            digests.append(simulation.diagnostics.digest())
            flown = simulation.vehicles.state().position_map.copy()
            simulation.restore(kept)
            simulation.run(8.0)
            np.testing.assert_array_equal(simulation.vehicles.state().position_map, flown)
    assert digests[0] == digests[1]


def test_a_team_that_does_not_name_its_own_uav_is_refused() -> None:
    wrong = scenario(2).with_({"types.bird.nodes[0].parameters.uavs": ["uav1"]})
    with pytest.raises(VoleryError, match="parameter uavs must name this UAV"):
        Simulation(wrong)
