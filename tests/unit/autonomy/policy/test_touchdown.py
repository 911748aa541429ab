"""The node `policy` at the touchdown of a policy that lands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from node_bench import NodeBench, odometry
from policy_making import small_policy

from volery.autonomy.policy.policy_file import write_policy
from volery.autonomy.policy.policy_node import PolicyNode
from volery.graph.codecs.zero import zero_message


class Bench(NodeBench):
    """A policy that lands, and a service `land`."""

    def __init__(self, folder: Path, *, is_asked: bool = True) -> None:
        super().__init__()
        write_policy(folder / "own.npz", small_policy())
        self.landings = 0
        self.graph.create_service("/uav1/land", "std_srvs/srv/Trigger", self._land)
        own = {"policy": str(folder / "own.npz"), "goal": [0.0, 0.0, 0.0]}
        self.node = self.start(PolicyNode, **own, land_at_touchdown=is_asked)
        self.commands = self.listen("/uav1/cmd_vel")
        self.statuses = self.listen("/uav1/policy/status")

    def _land(self, _request: Any) -> Any:
        self.landings += 1
        return zero_message("std_srvs/srv/Trigger_Response")

    def decide(self, *, airborne: bool) -> str:
        """Returns the state after the next decision."""
        state = zero_message("volery_interfaces/msg/FlightState")
        state.airborne = airborne
        self.send("/uav1/flight_state", state)
        self.send("/uav1/odom", odometry(self.now_ns, (0.0, 0.0, 1.0)))
        self.run_to((self.now_ns // 200_000_000 + 1) * 200_000_000)
        return str(json.loads(self.statuses[-1].data)["state"])


def test_the_node_lands_once_and_commands_no_more(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    assert bench.decide(airborne=False) == "flying"  # it takes off from the ground
    assert bench.decide(airborne=True) == "flying"
    flown = len(bench.commands)
    assert [bench.decide(airborne=False) for _ in range(3)] == ["landed"] * 3
    assert bench.landings == 1
    assert len(bench.commands) == flown
    assert bench.decide(airborne=True) == "flying"
    assert bench.decide(airborne=False) == "landed"
    assert bench.landings == 2


def test_the_node_flies_on_without_the_parameter(tmp_path: Path) -> None:
    bench = Bench(tmp_path, is_asked=False)
    assert {bench.decide(airborne=k % 2 == 0) for k in range(4)} == {"flying"}
    assert bench.landings == 0


def test_a_snapshot_holds_the_touchdown(tmp_path: Path) -> None:
    bench, other = Bench(tmp_path), Bench(tmp_path)
    for airborne in (True, False):
        bench.decide(airborne=airborne)
    other.node.set_state(bench.node.get_state())
    before = len(other.commands)
    other.send("/uav1/odom", odometry(0, (0.0, 0.0, 1.0)))
    other.run_to(400_000_000)
    assert len(other.commands) == before == 0
    assert other.landings == 0
