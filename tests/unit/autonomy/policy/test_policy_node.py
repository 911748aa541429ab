"""The node `policy`: what it commands, when it stops and why, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from node_bench import NodeBench, odometry, scan
from policy_making import chasing_policy, description, low_level_policy, mlp, small_policy

from volery.autonomy.policy.policy_file import Policy, make_policy, write_policy
from volery.autonomy.policy.policy_node import PolicyNode
from volery.core.errors import GraphError, NodeError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Odometry, PoseStamped, Quaternion

PERIOD_NS = 200_000_000
TOPICS = {
    "/uav1/cmd_vel",
    "/uav1/setpoint_raw/local",
    "/uav1/setpoint_raw/attitude",
    "/uav1/rotor_speeds",
}


class Bench(NodeBench):
    """A policy node, what it publishes, and a service `hold`."""

    def __init__(self, folder: Path, policy: Policy, **parameters: Any) -> None:
        super().__init__()
        write_policy(folder / "own.npz", policy)
        self.holds = 0
        self.graph.create_service("/uav1/hold", "std_srvs/srv/Trigger", self._hold)
        self.node = self.start(PolicyNode, policy=str(folder / "own.npz"), **parameters)
        names = ("status", "observation", "action", "value")
        for topic in self.graph.topics():
            if topic.name in TOPICS | {f"/uav1/policy/{name}" for name in names}:
                self.listen(topic.name)

    def _hold(self, _request: Any) -> Any:
        self.holds += 1
        return zero_message("std_srvs/srv/Trigger_Response")

    def decide(self, message: Odometry | None = None) -> None:
        """Sends odometry and runs to the next decision."""
        if message is not None:
            self.send("/uav1/odom", message)
        self.run_to((self.now_ns // PERIOD_NS + 1) * PERIOD_NS)

    @property
    def status(self) -> tuple[str, str]:
        status = json.loads(self.received["/uav1/policy/status"][-1].data)
        return status["state"], status["reason"]

    def last(self, topic: str) -> Any:
        return self.received[f"/uav1/{topic}"][-1]


def _goal(x: float, y: float, z: float, frame: str = "map") -> Any:
    goal = zero_message("geometry_msgs/msg/PoseStamped")
    goal.header.frame_id = frame
    goal.pose.position.x, goal.pose.position.y, goal.pose.position.z = x, y, z
    return goal


def test_it_observes_and_flies_towards_the_goal(tmp_path: Path) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[5.0, 0.0, 2.0])
    bench.decide(odometry(0, (2.0, 0.0, 2.0), (0.3, 0.0, 0.0), yaw=np.pi / 2))
    assert bench.status == ("flying", "")
    # the goal is 3 m to the right of the heading
    assert bench.last("policy/observation").data == pytest.approx(
        [0.0, -1.0, 0.0, 0.0, -0.3, 0.0], abs=1e-6
    )
    assert bench.last("policy/action").data == pytest.approx([4.0])
    assert bench.last("cmd_vel").linear.y == -1.0
    assert bench.last("policy/value").data == pytest.approx(2.85, abs=1e-5)


def test_it_waits_for_a_goal_and_commands_nothing_before(tmp_path: Path) -> None:
    bench = Bench(tmp_path, chasing_policy())
    bench.decide()
    assert bench.status == ("waiting", "no odometry yet")
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    assert bench.status == ("waiting", "no goal yet")
    assert not bench.received["/uav1/cmd_vel"]
    bench.send("/uav1/policy/goal_pose", _goal(0.0, 0.0, 9.0))
    bench.decide(odometry(bench.now_ns, (0.0, 0.0, 2.0)))
    assert bench.last("cmd_vel").linear.z == 1.0


def test_it_stops_without_odometry_and_goes_on_with_it(tmp_path: Path) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[5.0, 0.0, 2.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    bench.decide()
    assert bench.status[0] == "flying"
    bench.decide()
    bench.decide()
    assert bench.status == ("holding", "no odometry for 0.5 s")
    assert bench.last("cmd_vel").linear.x == 0.0
    bench.decide(odometry(bench.now_ns, (0.0, 0.0, 2.0)))
    assert bench.status == ("flying", "")
    assert bench.last("cmd_vel").linear.x == 1.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_odometry_that_is_no_motion_stops_it(tmp_path: Path, bad: float) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[5.0, 0.0, 2.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    bench.decide(odometry(0, (bad, 0.0, 2.0)))
    assert bench.status[0] == "holding"
    assert bench.status[1] in ("odometry is not finite", "odometry is impossible")
    message = odometry(0, (0.0, 0.0, 2.0))
    message.pose.pose.orientation = Quaternion(0.0, 0.0, 0.0, 0.0)
    bench.decide(message)
    assert bench.status == ("holding", "odometry is impossible")


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (_goal(np.nan, 0.0, 0.0), "goal is not finite"),
        (_goal(1e12, 0.0, 0.0), "goal is not finite"),
        (_goal(1.0, 0.0, 0.0, "uav1/odom"), "goal must be in 'map', not in 'uav1/odom'"),
    ],
)
def test_a_goal_that_is_none_stops_it(tmp_path: Path, goal: PoseStamped, reason: str) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[5.0, 0.0, 2.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    bench.send("/uav1/policy/goal_pose", goal)
    bench.decide()
    assert bench.status == ("holding", reason)


def test_far_goals_count_as_near_ones(tmp_path: Path) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[300.0, 400.0, 0.0], max_goal_distance_m=3.0)
    bench.decide(odometry(0, (0.0, 0.0, 0.0)))
    assert bench.last("policy/observation").data[:3] == pytest.approx([0.6, 0.8, 0.0])


def test_switched_off_it_stops_once_and_leaves_the_uav(tmp_path: Path) -> None:
    bench = Bench(tmp_path, chasing_policy(), goal=[5.0, 0.0, 2.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    bench.node.get_parameter("enabled").set(False)
    for _ in range(3):
        bench.decide(odometry(bench.now_ns, (0.0, 0.0, 2.0)))
    assert bench.status == ("waiting", "not enabled")
    assert [twist.linear.x for twist in bench.received["/uav1/cmd_vel"]] == [1.0, 0.0]


def test_attitudes_are_commanded(tmp_path: Path) -> None:
    bench = Bench(tmp_path, low_level_policy("attitude_thrust"), goal=[0.0, 0.0, 0.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    target = bench.last("setpoint_raw/attitude")
    assert target.type_mask == 7
    assert target.thrust == pytest.approx(0.6)
    assert target.orientation.x == pytest.approx(0.124, abs=0.02)


def test_rates_are_commanded_and_held_once(tmp_path: Path) -> None:
    bench = Bench(tmp_path, low_level_policy("rates_thrust"), goal=[0.0, 0.0, 0.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    target = bench.last("setpoint_raw/attitude")
    assert (target.type_mask, target.body_rate.y) == (128, 2.0)
    for _ in range(5):
        bench.decide()
    assert bench.status[0] == "holding"
    assert bench.holds == 1
    assert len(bench.received["/uav1/setpoint_raw/attitude"]) == 2


def test_rotor_speeds_are_commanded(tmp_path: Path) -> None:
    bench = Bench(tmp_path, low_level_policy("rotor_speeds"), goal=[0.0, 0.0, 0.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    assert bench.last("rotor_speeds").data == pytest.approx([0.8, 0.8, 0.85, 0.85])


def test_a_history_is_given_oldest_first(tmp_path: Path) -> None:
    goal, velocity = description()["observation"]
    policy = make_policy(
        description(observation=[goal, {**velocity, "history": 3}]),
        mlp("policy", [12, 4], np.random.default_rng(0)),
    )
    bench = Bench(tmp_path, policy, goal=[0.0, 0.0, 0.0])
    for speed in (1.0, 2.0):
        bench.decide(odometry(bench.now_ns, (0.0, 0.0, 0.0), (speed, 0.0, 0.0)))
    seen = bench.last("policy/observation").data
    assert seen[3:].reshape(3, 3)[:, 0] == pytest.approx([1.0, 1.0, 2.0])
    assert bench.last("policy/action").data == pytest.approx(policy.network.act(seen), abs=1e-6)


def test_a_snapshot_continues_alike(tmp_path: Path) -> None:
    policy = make_policy(
        description(
            observation=[{"name": "goal_body", "size": 3}, {"name": "last_action", "size": 4}]
        ),
        mlp("policy", [7, 4], np.random.default_rng(0)),
    )
    bench = Bench(tmp_path, policy, goal=[0.5, 0.2, 0.1])
    bench.decide(odometry(0, (0.0, 0.0, 0.0)))
    state = bench.node.get_state()
    bench.decide(odometry(bench.now_ns, (0.1, 0.0, 0.0)))
    first = bench.last("policy/action").data
    other = Bench(tmp_path, policy)
    other.node.set_state(state)
    other.decide(odometry(0, (0.1, 0.0, 0.0)))
    assert other.last("policy/action").data.tobytes() == first.tobytes()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"observation": [{"name": "smell", "size": 6}]}, "'smell', which no node computes"),
        ({"action": {"kind": "wish", "size": 4}}, "acts by 'wish'"),
        ({"action": {"kind": "velocity", "size": 4}}, "needs the parameter speed_m_s"),
        (
            {"action": {"kind": "rotor_speeds", "size": 4}},
            "parameter hover_speed_fractions, 4 numbers",
        ),
    ],
)
def test_policies_that_it_cannot_fly_are_refused(
    tmp_path: Path, changes: dict[str, Any], text: str
) -> None:
    with pytest.raises(NodeError, match=text):
        Bench(tmp_path, small_policy(**changes))


def test_a_part_of_another_size_is_refused_by_name(tmp_path: Path) -> None:
    policy = small_policy(observation=[{"name": "goal_body", "size": 6}])
    with pytest.raises(NodeError, match="'goal_body' has 3 numbers, not 6"):
        Bench(tmp_path, policy)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("policy", "no_such_policy"),
        ("policy", "absent.npz"),
        ("goal", [1.0, 2.0]),
        ("goal", [1.0, 2.0, np.nan]),
        ("timeout_s", 0.0),
        ("max_goal_distance_m", -1.0),
    ],
)
def test_parameters_out_of_range_are_refused(tmp_path: Path, name: str, value: Any) -> None:
    write_policy(tmp_path / "own.npz", small_policy())
    given = {"policy": str(tmp_path / "own.npz"), name: value}
    with pytest.raises((NodeError, GraphError), match=name):
        NodeBench().start(PolicyNode, **given)


def test_positions_are_commanded_from_the_present_one(tmp_path: Path) -> None:
    action = {
        "kind": "position",
        "size": 4,
        "parameters": {"range_m": 2.0, "yaw_rate_rad_s": 1.0},
    }
    zeros = {"policy.0.weight": np.zeros((4, 6)), "policy.0.bias": np.array([0.5, 0.0, 1.0, 0.2])}
    bench = Bench(tmp_path, make_policy(description(action=action), zeros), goal=[0.0, 0.0, 0.0])
    bench.decide(odometry(0, (1.0, 1.0, 2.0), yaw=np.pi / 2))
    target = bench.last("setpoint_raw/local")
    position = target.position
    assert (position.x, position.y, position.z) == pytest.approx((1.0, 2.0, 4.0))
    assert target.yaw_rate == pytest.approx(0.2)


def test_choices_are_rows_of_a_table(tmp_path: Path) -> None:
    action = {
        "kind": "choices",
        "size": 1,
        "choices": 2,
        "parameters": {
            "of": "velocity",
            "action": {"speed_m_s": 2.0, "yaw_rate_rad_s": 1.0},
            "table": [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, -1.0]],
        },
    }
    arrays = {"policy.0.weight": np.zeros((2, 6)), "policy.0.bias": np.array([0.0, 1.0])}
    described = description(action=action, network={"output": "argmax"})
    bench = Bench(tmp_path, make_policy(described, arrays), goal=[0.0, 0.0, 0.0])
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    twist = bench.last("cmd_vel")
    assert (twist.linear.x, twist.angular.z) == (1.0, -1.0)


def test_a_team_is_observed_by_its_odometry(tmp_path: Path) -> None:
    parameters = {"count": 2, "position_scale_m": 2.0, "velocity_scale_m_s": 1.0}
    part = {"name": "neighbours", "size": 14, "parameters": parameters}
    policy = make_policy(
        description(observation=[part]), mlp("policy", [14, 4], np.random.default_rng(0))
    )
    bench = Bench(tmp_path, policy, neighbours=["uav2", "uav3"])
    bench.send("/uav2/odom", odometry(0, (2.0, 0.0, 2.0), frame="uav2/odom"))
    bench.decide(odometry(0, (0.0, 0.0, 2.0)))
    seen = bench.last("policy/observation").data
    assert seen == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 7])


def test_scans_are_observed_by_sectors_along_a_line_at_a_height(tmp_path: Path) -> None:
    sectors = {
        "sensor": "horizontal",
        "sectors": 4,
        "angle_min_rad": -np.pi,
        "angle_max_rad": np.pi,
        "max_range_m": 10.0,
    }
    parts = [
        {"name": "lidar_sectors", "size": 4, "parameters": sectors},
        {"name": "line_offset", "size": 1},
    ]
    level = {"forward_m_s": 4.0, "lateral_m_s": 2.0, "keep_height_m": 3.0, "climb_m_s": 0.5}
    action = {"kind": "level_velocity", "size": 2, "parameters": level}
    arrays = {"policy.0.weight": np.zeros((2, 5)), "policy.0.bias": np.array([0.5, -0.5])}
    policy = make_policy(description(observation=parts, action=action), arrays)
    bench = Bench(tmp_path, policy, line=[0.0, 0.0, np.pi / 2])
    bench.decide(odometry(0, (1.0, 0.0, 2.0)))
    assert bench.status == ("waiting", "no scan yet")
    ranges = np.full(80, np.inf, np.float32)
    ranges[[10, 30, 50]] = 9.0, 5.0, 2.0
    bench.send("/uav1/laser/horizontal/scan", scan(bench.now_ns, ranges, last=0.975 * np.pi))
    bench.decide(odometry(bench.now_ns, (1.0, 0.0, 2.0)))
    seen = bench.last("policy/observation").data
    assert seen == pytest.approx([0.1, 0.5, 0.8, 0.0, -1.0], abs=1e-6)
    twist = bench.last("cmd_vel").linear
    assert (twist.x, twist.y, twist.z) == pytest.approx((3.0, -1.0, 0.5))
    bench.send("/uav1/laser/horizontal/scan", scan(bench.now_ns, np.full(80, np.nan)))
    bench.decide(odometry(bench.now_ns, (1.0, 0.0, 2.0)))
    assert bench.status == ("holding", "scan is not finite")
