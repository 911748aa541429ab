"""The node `policy` observes what the environments of the tasks observe."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from node_bench import NodeBench, odometry

from volery.autonomy.policy.course_inputs import GatesInput, TrajectoryInput
from volery.autonomy.policy.description import PolicyDescription
from volery.autonomy.policy.node_inputs import OdometryInput
from volery.autonomy.policy.observation_parts import INPUTS, PARTS, Observed, needed_inputs, observe
from volery.autonomy.policy.sensor_inputs import LineInput
from volery.core import rotations
from volery.core.errors import NodeError
from volery.graph.messages import (
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
)
from volery.learning.course_messages import path_of, trajectory_of
from volery.learning.episodes import Episodes
from volery.learning.policy_description import describe
from volery.learning.tasks import TASKS, load_task
from volery.learning.terms.observations import GOAL
from volery.learning.terms.trajectories import curve_motion

OF_MESSAGES = {"odometry", "goal", "neighbours", "posts", "trajectory", "gates"}
"""Inputs whose messages this test makes."""


def _is_served(name):
    parts = {part.name for part in load_task(name).observations}
    return parts <= set(PARTS) and all(set(PARTS[part].inputs) <= OF_MESSAGES for part in parts)


def _exact(name):
    """The task without what separates observations from the true state."""
    task = load_task(name)
    exact = {"noise": 0.0, "bias": 0.0, "latency_s": 0.0, "source": "truth"}
    return replace(
        task,
        observations=tuple(replace(part, **exact) for part in task.observations),
        action_latency_s=0.0,
    )


def _odometry(state, uav):
    """The true motion of a UAV of environment 0 as a message."""
    attitude = state.attitude[0, uav]
    velocity = rotations.rotate(rotations.conjugate(attitude), state.velocity_map[0, uav])
    covariance = np.zeros(36)
    pose = Pose(Point(*state.position_map[0, uav].tolist()), Quaternion(*attitude.tolist()))
    twist = Twist(Vector3(*velocity.tolist()), Vector3(*state.omega_body[0, uav].tolist()))
    return Odometry(
        header(0, f"uav{uav + 1}/odom"),
        f"uav{uav + 1}/base_link",
        PoseWithCovariance(pose, covariance),
        TwistWithCovariance(twist, covariance),
    )


def _goal(flight):
    goal = PoseStamped(header=header(0, "map"))
    goal.pose.position = Point(*flight.values[GOAL][0, 0].tolist())
    return goal


def _moving_goal(episodes, observation):
    """The goal as odometry with the velocity that is observed, which tasks define."""
    first = 0
    for part in episodes.task.observations:
        if part.name == "goal_velocity_heading":
            level = observation[first : first + 3] * part.scale
        first += part.numbers
    yaw = rotations.yaw_of(episodes.flight.state.attitude[0, 0])
    velocity = rotations.rotate(rotations.from_rpy(0.0, 0.0, yaw), level)
    covariance = np.zeros(36)
    pose = Pose(_goal(episodes.flight).pose.position, Quaternion(0.0, 0.0, 0.0, 1.0))
    twist = Twist(Vector3(*velocity.tolist()), Vector3(0.0, 0.0, 0.0))
    return Odometry(
        header(0, "map"),
        "",
        PoseWithCovariance(pose, covariance),
        TwistWithCovariance(twist, covariance),
    )


@pytest.mark.parametrize("name", list(filter(_is_served, TASKS)))
def test_the_node_observes_as_the_environment(name):
    task = _exact(name)
    description = PolicyDescription.model_validate(json.loads(json.dumps(describe(task).to_json())))
    episodes = Episodes(task, 1, seed=5, threads=1)
    try:
        flight, action = episodes.flight, task.action
        episodes.begin(np.arange(1))
        shape = (1, task.num_agents, action.size)
        choice = np.full(shape, 0.3 if action.choices is None else 1.0)
        for _ in range(3):
            episodes.decide(choice)
        expected = episodes.observe(np.arange(1))[0, 0]
        bench = NodeBench()
        posts = flight.values.get("posts_map", np.zeros((1, 0, 3)))[0].tolist()
        node = bench.start(
            _Bare, neighbours=[f"uav{k + 2}" for k in range(task.num_agents - 1)], posts=posts
        )
        inputs = {key: INPUTS[key](node, 1.0) for key in needed_inputs(description)}
        for uav in range(flight.num_uavs):
            bench.send(f"/uav{uav + 1}/odom", _odometry(flight.state, uav))
        if "goal_velocity_heading" in {part.name for part in description.observation}:
            bench.send("/uav1/bare/goal_odometry", _moving_goal(episodes, expected))
        elif GOAL in flight.values:
            bench.send("/uav1/bare/goal_pose", _goal(flight))
        _send_course(bench, flight)
        assert not any(source.fault(0) for source in inputs.values())
        observed = Observed(inputs, choice[0, 0])
        histories = {}
        seen = observe(description.observation, observed, histories)
    finally:
        episodes.close()
    np.testing.assert_allclose(seen, expected, atol=1e-6)


def _send_course(bench, flight):
    """The trajectory, begun as long ago as the episode; or the gates that are ahead."""
    if "curve" in flight.values:
        bench.now_ns = round(flight.decisions[0] / flight.decision_rate_hz * 1e9)
        bench.send("/uav1/bare/trajectory", trajectory_of(flight.values["curve"][:1], 2.0, 0))
    if "gates" in flight.values:
        bench.send("/uav1/bare/gates", path_of(flight.values["gates"][0], 0))


def _gates_node(bench, **parameters):
    node = bench.start(_Bare, **parameters)
    OdometryInput(node, 1.0)
    return GatesInput(node, 1.0)


GATES = [[4.0, 0.0, 2.0, 0.0], [8.0, 0.0, 2.0, math.pi / 2], [8.0, 4.0, 2.0, 0.0]]


@pytest.mark.parametrize(
    ("path", "passed"),
    [
        ([[3.0, 0.0, 2.0], [5.0, 0.0, 2.0]], 1),
        ([[5.0, 0.0, 2.0], [3.0, 0.0, 2.0]], 0),  # backwards
        ([[3.0, 0.9, 2.0], [5.0, 0.9, 2.0]], 0),  # beside the opening
        ([[7.0, -1.0, 2.0], [8.0, 1.0, 2.0]], 0),  # the second one first
        ([[3.0, 0.0, 2.0], [5.0, 0.0, 2.0], [8.0, -1.0, 2.0], [8.0, 1.0, 2.0]], 2),
    ],
)
def test_the_node_passes_gates_in_order_and_in_their_direction(path, passed):
    bench = NodeBench()
    source = _gates_node(bench, gates=GATES)
    for k, position in enumerate(path):
        bench.send("/uav1/odom", odometry(k, position))
    ahead = [GATES[min(passed + k, 2)] for k in range(2)]
    np.testing.assert_allclose(source.ahead(2), ahead)
    bench.send("/uav1/bare/gates", path_of(np.array(GATES), 0))
    np.testing.assert_allclose(source.ahead(2), GATES[:2], atol=1e-12)


def test_gates_that_are_no_gates_are_refused():
    bench = NodeBench()
    with pytest.raises(NodeError, match=r"gates must be a list of \[x, y, z, yaw\]"):
        _gates_node(bench, gates=[[1.0, 2.0, 3.0]])
    source = _gates_node(NodeBench())
    assert source.fault(0) == "no gates yet"


def test_a_trajectory_has_a_beginning_and_an_end():
    bench = NodeBench()
    source = TrajectoryInput(bench.start(_Bare), 1.0)
    assert source.fault(0) == "no trajectory yet"
    curve = np.array([[[0.0] * 3, [1.0, 2.0, 3.0], [1.0] * 3, [0.0] * 3]])
    bench.send("/uav1/bare/trajectory", trajectory_of(curve, 2.0, 1_000_000_000))
    assert source.fault(0) == "the trajectory has not begun"
    assert source.fault(1_500_000_000) == ""
    assert source.fault(3_100_000_000) == "the trajectory has ended"
    bench.now_ns = 1_505_000_000
    points = source.points([0.0, 0.5])
    expected, _ = curve_motion(curve, np.array([[0.505, 1.005]]))
    np.testing.assert_allclose(points, expected[0], atol=2e-4)
    bench.send("/uav1/bare/trajectory", trajectory_of(curve * np.nan, 2.0, 0))
    assert "finite" in source.fault(1_500_000_000)


def test_a_pose_sets_the_line():
    bench = NodeBench()
    source = LineInput(bench.start(_Bare), 1.0)
    pose = PoseStamped(header=header(0, "map"))
    pose.pose.position = Point(1.0, 2.0, 0.0)
    pose.pose.orientation = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    bench.send("/uav1/bare/line_pose", pose)
    assert source.lateral_m(np.array([0.0, 7.0, 3.0])) == pytest.approx(1.0)
    pose = PoseStamped(header=header(0, "map"))
    pose.pose.orientation = Quaternion(0.0, 0.0, 0.0, 0.0)
    bench.send("/uav1/bare/line_pose", pose)
    assert source.fault(0) == "line is no pose"


class _Bare:
    """Makes a node that only holds inputs."""

    def __new__(cls, **options):
        from volery.graph.nodes.node import Node

        return Node("bare", **options)
