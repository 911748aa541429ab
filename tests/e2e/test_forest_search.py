"""A part of the forest search: two UAVs divide it by radio, and a second run is equal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from volery.autonomy.team.task_manager import TaskManager
from volery.engine.events import EventKind
from volery.graph.nodes.node import Node
from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario


def test_no_node_receives_ground_truth_or_another_uav_except_by_radio(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All topics and services that nodes of the whole scenario use are their own UAV's."""
    asked: list[tuple[str, str]] = []

    def noting(method: Any) -> Any:
        def note(self: Node, kind: Any, name: str, *rest: Any, **options: Any) -> Any:
            asked.append((self.get_namespace(), self.resolve(name)))
            return method(self, kind, name, *rest, **options)

        return note

    for method in ("create_subscription", "create_client"):
        monkeypatch.setattr(Node, method, noting(getattr(Node, method)))
    scenario = load_scenario("forest_search")
    with Simulation(scenario) as simulation:
        truths = [t for t in simulation.graph.topics() if "ground_truth" in t.name]
        assert len(truths) >= len(simulation.uavs)
        assert [t.name for t in truths if t.subscribers] == []
        assert len(asked) > 20 * len(simulation.uavs)
    for namespace, name in asked:
        assert name == "/tf" or name.startswith(f"{namespace}/")
        assert "ground_truth" not in name


@pytest.mark.slow
def test_two_share_the_forest_and_repeat_themselves() -> None:
    scenario = overrides.apply(load_scenario("forest_search"), uavs=2)
    with Simulation(scenario) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.run(11.0)
        kept = simulation.snapshot()
        began = [uav.position_map for uav in simulation.uavs.values()]
        simulation.run(4.0)
        positions, digest = (
            [uav.position_map for uav in simulation.uavs.values()],
            simulation.diagnostics.digest(),
        )

        managers = [node for node in simulation.vehicles.nodes if isinstance(node, TaskManager)]
        assert [str(manager.phase) for manager in managers] == ["search", "search"]
        assert len({manager.member.sector for manager in managers}) == 2
        assert [set(manager.member.team.mates) for manager in managers] == [{"uav2"}, {"uav1"}]
        for start, end in zip(began, positions, strict=True):
            assert np.hypot(*(end - start)[:2]) > 1.5
        contacts = {EventKind.COLLISION, EventKind.IMPACT}
        assert not [event for event in simulation.diagnostics.events if event.kind in contacts]

        simulation.restore(kept)
        for _ in range(2):
            simulation.run(2.0)
        assert simulation.diagnostics.digest() == digest
        again = [uav.position_map for uav in simulation.uavs.values()]
        np.testing.assert_array_equal(again, positions)


@pytest.mark.slow
def test_an_operators_hold_holds_until_resume() -> None:
    """The planners' next velocities do not end it, and another one takes the sector over."""
    scenario = overrides.apply(load_scenario("forest_search"), uavs=2)
    with Simulation(scenario) as simulation:
        simulation.run(14.0)
        uav, graph = simulation.uavs["uav2"], simulation.graph
        (manager,) = (
            node
            for node in simulation.vehicles.nodes
            if isinstance(node, TaskManager) and node.settings.name == "uav2"
        )
        assert str(manager.phase) == "search"
        assert np.linalg.norm(uav.velocity_map) > 0.5
        assert graph.call("/uav2/task_manager/hold").success
        simulation.run(3.0)
        position = uav.position_map
        simulation.run(3.0)
        assert uav.mode.name == "HOLD"
        assert (str(manager.phase), manager.member.sector) == ("hold", -1)
        assert "held by the operator" in manager.problem
        assert np.linalg.norm(uav.position_map - position) < 0.3
        assert graph.call("/uav2/task_manager/resume").success
        simulation.run(5.0)
        assert str(manager.phase) == "search"
        assert np.linalg.norm(uav.position_map - position) > 1.5
        assert graph.call("/uav2/task_manager/land").success
        simulation.run(8.0)
        assert (str(manager.phase), manager.member.sector) == ("done", -1)
        assert manager.problem == "landed by the operator"
