"""A part of the forest search: two UAVs share it out by radio, and the same happens again."""

from __future__ import annotations

import numpy as np
import pytest

from volery.autonomy.task_manager import TaskManager
from volery.engine.events import EventKind
from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario


@pytest.mark.slow
def test_two_share_the_forest_and_repeat_themselves() -> None:
    scenario = overrides.apply(load_scenario("forest_search"), uavs=2)
    with Simulation(scenario) as simulation:
        simulation.enable_digest()
        simulation.run(11.0)
        kept = simulation.snapshot()
        began = [uav.position_map for uav in simulation.uavs.values()]
        simulation.run(4.0)
        places, digest = [uav.position_map for uav in simulation.uavs.values()], simulation.digest()

        managers = [node for node in simulation.nodes if isinstance(node, TaskManager)]
        assert [str(manager.phase) for manager in managers] == ["search", "search"]
        assert len({manager.sector for manager in managers}) == 2
        assert [set(manager.team.mates) for manager in managers] == [{"uav2"}, {"uav1"}]
        for start, end in zip(began, places, strict=True):
            assert np.hypot(*(end - start)[:2]) > 1.5
        contacts = {EventKind.COLLISION, EventKind.IMPACT}
        assert not [event for event in simulation.events if event.kind in contacts]

        simulation.restore(kept)
        for _ in range(2):
            simulation.run(2.0)
        assert simulation.digest() == digest
        again = [uav.position_map for uav in simulation.uavs.values()]
        np.testing.assert_array_equal(again, places)
