"""The radio of a running simulation: topics, obstacles, faults, snapshots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError
from volery.graph.messages import String
from volery.graph.nodes.node import Node
from volery.runtime import Simulation
from volery.runtime.construction.line_of_sight import LineOfSight
from volery.scenario.load import parse_scenario

TOPICS = [{"name": "hello", "type": "std_msgs/msg/String"}]


class Talker(Node):
    """Says its name ten times a second, and counts what it receives, by sender."""

    def __init__(self, **options: Any) -> None:
        super().__init__("talker", **options)
        self.received: list[tuple[int, str]] = []
        self._says = self.create_publisher(String, "hello")
        self.create_subscription(String, "radio/hello", self._receive)
        self.create_timer(0.1, lambda: self._says.publish(String(self.get_namespace())))

    def _receive(self, message: String) -> None:
        self.received.append((self.get_clock().now_ns(), message.data))

    def get_state(self) -> dict[str, Any]:
        return {"received": list(self.received)}

    def set_state(self, state: dict[str, Any]) -> None:
        self.received = list(state["received"])


def scenario_of(last_x: float = 60.0, count: int = 3, **radio: Any) -> Any:
    return parse_scenario(
        {
            "name": "talk",
            "radio": {"topics": TOPICS, **radio},
            "types": {
                "talker": {"nodes": [{"node": f"{__name__}:Talker"}], "sensors": []},
                "mute": {"radio": False},
            },
            "uavs": [
                {
                    "type": "talker",
                    "count": count,
                    "position_m": [0.0, 0.0],
                    "last_position_m": [last_x, 0.0],
                },
                {"type": "mute", "position_m": [0.0, 30.0]},
            ],
        }
    )


def received_by(simulation: Simulation, row: int = 0) -> list[tuple[int, str]]:
    node = simulation.vehicles.nodes[row]
    assert isinstance(node, Talker)
    return node.received


def test_every_uav_with_a_radio_receives_the_others() -> None:
    with Simulation(scenario_of()) as simulation:
        simulation.run(1.0)
        for row in range(3):
            senders = [name for _, name in received_by(simulation, row)]
            others = [f"/uav{k + 1}" for k in range(3) if k != row]
            assert set(senders) == set(others)
            assert len(senders) >= 16
        late = [time_ns % 100_000_000 for time_ns, _ in received_by(simulation)]
        assert min(late) >= 2_000_000  # latency and time on the air
        assert "/uav4/radio/hello" not in [topic.name for topic in simulation.graph.topics()]
        assert simulation.vehicles.radio is not None
        assert simulation.vehicles.radio.statistics.lost_on_link <= 4


def test_ideal_links_take_no_time() -> None:
    with Simulation(scenario_of(links="ideal")) as simulation:
        simulation.run(1.0)
        assert len(received_by(simulation)) == 20
        assert {time_ns % 100_000_000 for time_ns, _ in received_by(simulation)} == {0}


def test_a_lost_radio_neither_sends_nor_receives() -> None:
    with Simulation(scenario_of(links="ideal")) as simulation:
        simulation.faults.inject({"kind": "radio", "uav": "uav2", "at_s": 1.05, "until_s": 2.05})
        simulation.run(3.0)
        missing = [t for t, _ in received_by(simulation, 1) if 1.05e9 < t < 2.05e9]
        assert missing == []
        to_first = [t for t, name in received_by(simulation) if name == "/uav2"]
        assert len(to_first) == 20
        assert len(received_by(simulation, 1)) == 40
        with pytest.raises(CommandError, match="uav4 has no radio; with one: uav1"):
            simulation.faults.inject({"kind": "radio", "uav": "uav4"})


JAMMER = {"kind": "jamming", "position_m": [75.0, 0.0, 5.0], "power_dbm": 20.0}
"""15 m beyond the last of three UAVs in a row, 30 m apart."""


def test_a_jammer_silences_the_radios_near_it_for_others() -> None:
    with Simulation(scenario_of(shadowing_db=0.0)) as simulation:
        simulation.faults.inject({**JAMMER, "at_s": 1.05, "until_s": 2.05})
        simulation.run(1.5)
        (fault,) = simulation.faults.active
        assert fault.kind == "jamming"
        assert "jamming" in repr(simulation.faults)
        simulation.vehicles.reset("uav1")  # it is of no UAV
        assert simulation.faults.active == (fault,)
        kept = simulation.snapshot()
        for _ in range(2):
            simulation.run(1.5)
            during = [[name for t, name in received_by(simulation, row) if 1.05e9 < t < 2.05e9]
                      for row in (0, 2)]  # fmt: skip
            assert during[1] == []  # the jammer is nearer to it than the others
            assert set(during[0]) == {"/uav2", "/uav3"}
            after = [name for t, name in received_by(simulation, 2) if t > 2.05e9]
            assert set(after) == {"/uav1", "/uav2"}
            assert simulation.faults.active == ()
            simulation.restore(kept)


def test_a_jammer_is_ended_by_what_describes_it_and_by_a_reset() -> None:
    with Simulation(scenario_of(shadowing_db=0.0)) as simulation:
        simulation.faults.inject(JAMMER)
        simulation.run(1.0)
        assert received_by(simulation, 2) == []
        simulation.faults.end({**JAMMER, "power_dbm": 21.0})  # another one
        simulation.run(0.5)
        assert received_by(simulation, 2) == []
        simulation.faults.end(JAMMER)
        simulation.run(0.5)
        assert received_by(simulation, 2) != []
        simulation.faults.inject(JAMMER)
        simulation.run(0.5)
        simulation.reset()
        simulation.run(0.5)
        assert simulation.faults.active == ()
        assert received_by(simulation, 2) != []


def test_jamming_needs_radios_whose_links_are_modelled() -> None:
    ideal, modelled = scenario_of(links="ideal"), scenario_of()
    far = {**JAMMER, "position_m": [0.0, 0.0, 1e7]}
    for scenario, fault, words in (
        (ideal, JAMMER, 'links = "ideal" know no noise'),
        (modelled, far, "position_m"),
    ):
        with Simulation(scenario) as simulation, pytest.raises(CommandError, match=words):
            simulation.faults.inject(fault)


def test_a_snapshot_holds_what_is_on_the_air() -> None:
    with Simulation(scenario_of(latency_s=0.03, power_dbm=-18.0)) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.run(1.01)  # sent, not yet received
        kept = simulation.snapshot()
        simulation.run(1.5)
        first, digest = received_by(simulation), simulation.diagnostics.digest()
        simulation.restore(kept)
        simulation.run(1.5)
        assert received_by(simulation) == first
        assert simulation.diagnostics.digest() == digest
        simulation.reset(seed=9)
        simulation.run(2.51)
        assert received_by(simulation) != first


@pytest.mark.parametrize("slices", [1, 7])
def test_slicing_and_threads_change_nothing(slices: int) -> None:
    digests = []
    for threads, parts in ((1, 1), (2, slices)):
        with Simulation(scenario_of(power_dbm=-18.0), threads=threads) as simulation:
            simulation.diagnostics.enable_digest()
            for _ in range(parts):
                simulation.run(1.4 / parts)
            digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_a_uav_that_comes_later_is_received() -> None:
    with Simulation(scenario_of(links="ideal")) as simulation:
        simulation.run(0.5)
        simulation.vehicles.spawn("late", "talker", [30.0, 20.0, 0.0])
        simulation.run(0.5)
        assert "/late" in {name for _, name in received_by(simulation)}
        simulation.vehicles.delete("late")
        simulation.run(0.5)
        assert received_by(simulation)[-1][0] > 1.3e9


@pytest.mark.parametrize("links", ["ideal", "modelled"])
def test_a_uav_that_replaces_another_has_a_radio_of_its_own(links: str) -> None:
    with Simulation(scenario_of(links=links)) as simulation:
        for _ in range(2):
            row = len(simulation.vehicles.nodes)
            simulation.vehicles.spawn("uav9", "talker", [30.0, 20.0, 0.0])
            simulation.run(0.5)
            senders = [name for _, name in received_by(simulation)]
            assert senders.count("/uav9") >= 4
            assert 8 <= len(received_by(simulation, row)) <= 15  # of three, and nothing of before
            simulation.vehicles.delete("uav9")
            simulation.run(0.5)
            received_by(simulation).clear()


def test_what_stands_between() -> None:
    """A block, an oak and a hill in three lines of sight, and nothing in a fourth."""
    scenario = parse_scenario(
        {
            "name": "between",
            "world": {
                "forest": {
                    "kind": "procedural",
                    "region_m": [-60.0, 5.0, 60.0, 65.0],
                    "trees": 90,
                    "minimum_spacing_m": 4.0,
                    "species": {"broadleaf": 1.0},
                },
                "grid_map": {
                    "maps": [{"file": "gridmaps/one_block.csv"}],
                    "cell_size_m": 2.0,
                    "origin_m": [0.0, -20.0],
                },
            },
            "types": {"one": {}},
            "uavs": [{"type": "one", "position_m": [0.0, -40.0]}],
        }
    )
    with Simulation(scenario) as simulation:
        forest = simulation.world.forest
        assert forest is not None
        sight = LineOfSight(simulation.world.scene, forest)
        tree = int(np.argmax(forest.height_m))
        x, y, _ = forest.position_map[tree]
        crown = 0.65 * forest.height_m[tree]
        starts = np.array([[-10, -19, 1], [x - 30, y, crown], [-10, -30, 1], [0, -60, 2]])
        ends = np.array([[10, -19, 1], [x + 30, y, crown], [10, -30, 1], [9, -60, -2]])
        paths = sight(starts, ends)
        assert paths.walls.tolist() == [2, 0, 0, 0]
        assert paths.ground.tolist() == [False, False, False, True]
        assert 3.0 < paths.foliage_m[1] < 45.0
        assert paths.foliage_m[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]
        back = sight(ends, starts)
        np.testing.assert_allclose(back.foliage_m, paths.foliage_m)
        assert back.walls.tolist() == paths.walls.tolist()
        low = sight(np.array([[x - 1.5, y, 1.3]]), np.array([[x + 1.5, y, 1.3]]))
        assert low.trunks.tolist() == [1]


def test_topics_are_named_once() -> None:
    with pytest.raises(ScenarioError, match="named twice: hello"):
        scenario_of(topics=TOPICS * 2)
