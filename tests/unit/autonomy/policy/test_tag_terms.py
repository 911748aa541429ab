"""The part `tag`: its geometry, and the node's input from detections and odometry."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from node_bench import NodeBench, odometry
from policy_making import description, mlp

from volery.autonomy.policy.policy_file import Policy, make_policy, write_policy
from volery.autonomy.policy.policy_node import PolicyNode
from volery.autonomy.policy.tag_terms import CAMERA_FROM_OPTICAL, tag_from_uav, tag_observation
from volery.core import rotations
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import header

DOWN = (0.0, 90.0, 0.0)
PARAMETERS = {
    "range_m": 3.0,
    "memory_s": 2.0,
    "tag_id": 7,
    "tag_size_m": 0.5,
    "mount_m": [0.1, 0.0, -0.05],
    "mount_rpy_deg": list(DOWN),
}
MS = 1_000_000


def optical_pose(position, attitude, tag, tag_yaw):
    """Pose of a tag in the optical frame of the camera of `PARAMETERS`."""
    mounted = rotations.from_rpy(*np.radians(DOWN))
    camera = rotations.multiply(rotations.multiply(attitude, mounted), CAMERA_FROM_OPTICAL)
    eye = np.asarray(position) + rotations.rotate(attitude, PARAMETERS["mount_m"])
    back = rotations.conjugate(camera)
    turned = rotations.multiply(back, rotations.from_rpy(0.0, 0.0, tag_yaw))
    return rotations.rotate(back, np.asarray(tag) - eye), turned


def test_a_tag_is_found_where_it_lies_at_any_attitude():
    random = np.random.default_rng(3)
    for _ in range(20):
        attitude = rotations.from_rpy(*random.uniform(-0.4, 0.4, 2), random.uniform(-3, 3))
        position, tag = random.uniform(3, 8, 3), random.uniform(-5, 2, 3)
        yaw = random.uniform(-3, 3)
        pose = optical_pose(position, attitude, tag, yaw)
        found, turned = tag_from_uav(*pose, attitude, PARAMETERS["mount_m"], DOWN)
        np.testing.assert_allclose(found, tag - position, atol=1e-9)
        assert math.cos(float(turned) - yaw) == pytest.approx(1.0)


def test_batches_equal_single_tags():
    random = np.random.default_rng(4)
    positions, turns = random.normal(size=(5, 2, 3)), random.normal(size=(5, 2, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    whole = tag_from_uav(positions, turns, turns, PARAMETERS["mount_m"], DOWN)
    one = tag_from_uav(positions[3, 1], turns[3, 1], turns[3, 1], PARAMETERS["mount_m"], DOWN)
    np.testing.assert_array_equal(whole[0][3, 1], one[0])
    assert whole[1][3, 1] == one[1]


def test_the_observation_is_in_the_heading_frame_and_ages():
    attitude = rotations.from_rpy(0.2, -0.1, math.pi / 2)
    terms = {"range_m": 3.0, "memory_s": 2.0}
    seen = tag_observation([0.0, 3.0, -6.0], math.pi, 0.5, attitude, **terms)
    np.testing.assert_allclose(seen, [1.0, 0.0, -2.0, 0.0, 1.0, 0.25], atol=1e-9)
    ages = np.array([0.0, 1.9, 2.0, np.inf])
    many = tag_observation(np.ones((4, 3)), np.zeros(4), ages, np.tile(attitude, (4, 1)), **terms)
    assert many[:, 5].tolist() == [0.0, 0.95, 1.0, 1.0]
    assert (many[2:, :5] == 0.0).all()
    assert many[:2, :3].any(axis=1).all()


def tag_policy() -> Policy:
    part = {"name": "tag", "size": 6, "unit": "1", "parameters": PARAMETERS}
    described = description(task="servoing", observation=[part], decision_rate_hz=10.0)
    return make_policy(described, mlp("policy", [6, 4], np.random.default_rng(0)))


class Bench(NodeBench):
    """A policy that observes a tag."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        write_policy(folder / "tag.npz", tag_policy())
        self.node = self.start(PolicyNode, policy=str(folder / "tag.npz"))
        self.observations = self.listen("/uav1/policy/observation")

    def detect(self, time_ns: int, pose: Any = None, class_id: str = "36h11:7") -> None:
        array = zero_message("vision_msgs/msg/Detection3DArray")
        array.header = header(time_ns, "uav1/camera_optical")
        if pose is not None:
            one = zero_message("vision_msgs/msg/Detection3D")
            result = zero_message("vision_msgs/msg/ObjectHypothesisWithPose")
            result.hypothesis.class_id = class_id
            p, q = result.pose.pose.position, result.pose.pose.orientation
            p.x, p.y, p.z = (float(v) for v in pose[0])
            q.x, q.y, q.z, q.w = (float(v) for v in pose[1])
            one.results = [result]
            array.detections = [one]
        self.send("/uav1/tag_detection/detections", array)

    def fly(self, time_ns: int, x: float) -> None:
        """Moves along x at 1 m/s, facing y."""
        self.send("/uav1/odom", odometry(time_ns, (x, 0.0, 4.0), (1.0, 0.0, 0.0), yaw=math.pi / 2))

    def decide(self) -> Any:
        self.run_to((self.now_ns // (100 * MS) + 1) * 100 * MS)
        return self.observations[-1].data if self.observations else None


def test_the_node_carries_a_detection_on_by_odometry(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.fly(0, 0.0)
    assert bench.decide() is None  # no detections yet, not even none
    bench.fly(100 * MS, 0.1)
    bench.detect(100 * MS)
    np.testing.assert_allclose(bench.decide(), [0, 0, 0, 0, 0, 1])
    # an image of 150 ms, at x = .15, arrives at 200 ms
    attitude = rotations.from_rpy(0.0, 0.0, math.pi / 2)
    pose = optical_pose([0.15, 0.0, 4.0], attitude, [1.0, 2.0, 0.0], 0.3)
    bench.fly(200 * MS, 0.2)
    bench.detect(150 * MS, pose)
    bench.fly(300 * MS, 0.3)
    turn = 0.3 - math.pi / 2
    wanted = [2.0 / 3, -0.7 / 3, -4.0 / 3, math.cos(turn), math.sin(turn), 0.15 / 2.0]
    np.testing.assert_allclose(bench.decide(), wanted, atol=1e-6)


def test_impossible_and_foreign_detections_are_left_out(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.fly(0, 0.0)
    level = np.array([0.0, 0.0, 0.0, 1.0])
    for pose, name in (
        (([math.nan, 0, 1], level), "36h11:7"),
        (([0, 0, 1e9], level), "36h11:7"),
        (([0, 0, 1], 0.0 * level), "36h11:7"),
        (([0, 0, 1], level), "36h11:8"),
        (([0, 0, 1], level), "25h9:7"),
    ):
        bench.detect(0, pose, name)
    assert bench.decide()[5] == 1.0


def test_a_snapshot_holds_the_tag(tmp_path: Path) -> None:
    bench, other = Bench(tmp_path), Bench(tmp_path)
    bench.fly(0, 0.0)
    pose = optical_pose([0.0, 0.0, 4.0], rotations.from_rpy(0, 0, math.pi / 2), [1, 1, 0], 0.0)
    bench.detect(0, pose)
    other.node.set_state(bench.node.get_state())
    np.testing.assert_array_equal(bench.decide(), other.decide())
