"""`tf_transformations`, `tf2_geometry_msgs` and `tf2_sensor_msgs`."""

import itertools
import math

import numpy as np
import pytest

from volery.core import rotations
from volery.graph.messages import (
    Header,
    PointStamped,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
    message_type,
)
from volery.graph.nodes import point_cloud2
from volery.graph.nodes import tf_transformations as tf
from volery.graph.nodes.tf2 import Buffer, LookupException, TypeException

AXES = [
    kind + "".join(turns)
    for kind in "sr"
    for turns in itertools.product("xyz", repeat=3)
    if turns[0] != turns[1] != turns[2]
]


def turn(axis, angle):
    """Rotation matrix about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


@pytest.mark.parametrize("axes", AXES)
def test_angles_about_all_axes(axes):
    rng = np.random.default_rng(3)
    degenerate = [(0.3, middle, 0.4) for middle in (0.0, math.pi / 2, -math.pi / 2, math.pi)]
    for angles in (*rng.uniform(-3.0, 3.0, (20, 3)), *degenerate):
        a, b, c = (turn(axis, angle) for axis, angle in zip(axes[1:], angles, strict=True))
        expected = a @ b @ c if axes[0] == "r" else c @ b @ a
        matrix = tf.euler_matrix(*angles, axes)
        np.testing.assert_allclose(matrix[:3, :3], expected, atol=1e-12)
        back = tf.euler_matrix(*tf.euler_from_matrix(matrix, axes), axes)
        np.testing.assert_allclose(back, matrix, atol=1e-7)  # half the digits where axes coincide
        quaternion = tf.quaternion_from_matrix(matrix)
        np.testing.assert_allclose(tf.quaternion_matrix(quaternion), matrix, atol=1e-12)


def test_roll_pitch_and_yaw():
    q = tf.quaternion_from_euler(0.1, 0.2, 0.3)
    np.testing.assert_allclose(q, rotations.from_rpy(0.1, 0.2, 0.3))
    np.testing.assert_allclose(tf.euler_from_quaternion(q), (0.1, 0.2, 0.3))
    for wrong in ("xyz", "sxxy", "sabc", ""):
        with pytest.raises(ValueError, match="axes are such as"):
            tf.quaternion_from_euler(0.0, 0.0, 0.0, wrong)


def test_matrices():
    moved = tf.concatenate_matrices(
        tf.translation_matrix([1, 2, 3]), tf.rotation_matrix(math.pi / 2, [0, 0, 2])
    )
    np.testing.assert_allclose(moved @ [1, 0, 0, 1], [1, 3, 3, 1], atol=1e-12)
    np.testing.assert_allclose(tf.translation_from_matrix(moved), [1, 2, 3])
    np.testing.assert_allclose(tf.inverse_matrix(moved) @ moved, tf.identity_matrix(), atol=1e-12)
    half = tf.quaternion_slerp([0, 0, 0, 1], tf.quaternion_about_axis(1.0, [0, 1, 0]), 0.5)
    np.testing.assert_allclose(half, tf.quaternion_about_axis(0.5, [0, 1, 0]))


@pytest.fixture
def buffer():
    """`T_map_probe`: 1 m along x, turned to the left."""
    found = Buffer()
    quarter = Quaternion(*rotations.from_rpy(0.0, 0.0, math.pi / 2).tolist())
    found.set_transform(
        TransformStamped(Header(frame_id="/map"), "probe", Transform(Vector3(x=1.0), quarter)), ""
    )
    return found


def test_points_and_poses(buffer):
    point = PointStamped(Header(frame_id="probe"))
    point.point.x = 2.0
    moved = buffer.transform(point, "map")
    assert (moved.point.x, moved.point.y) == pytest.approx((1.0, 2.0))
    assert moved.header.frame_id == "map"
    pose = PoseStamped(Header(frame_id="probe"))
    assert rotations.yaw_of(rotations.IDENTITY) == 0.0
    q = buffer.transform(pose, "map").pose.orientation
    assert rotations.yaw_of([q.x, q.y, q.z, q.w]) == pytest.approx(math.pi / 2)


def test_a_vector_is_turned_and_not_moved(buffer):
    vector = message_type("geometry_msgs/msg/Vector3Stamped")(Header(frame_id="probe"))
    vector.vector.x = 2.0
    moved = buffer.transform(vector, "map").vector
    assert (moved.x, moved.y, moved.z) == pytest.approx((0.0, 2.0, 0.0))


def test_a_covariance_is_turned(buffer):
    pose = message_type("geometry_msgs/msg/PoseWithCovarianceStamped")(Header(frame_id="probe"))
    pose.pose.covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).ravel()
    moved = buffer.transform(pose, "map").pose
    assert np.diag(moved.covariance.reshape(6, 6)) == pytest.approx([2, 1, 3, 5, 4, 6])
    assert moved.pose.position.x == pytest.approx(1.0)


def test_a_cloud_keeps_its_other_fields(buffer):
    fields = [*point_cloud2.create_cloud_xyz32(Header(), []).fields]
    fields.append(type(fields[0])("intensity", 12, 7, 1))
    cloud = point_cloud2.create_cloud(Header(frame_id="probe"), fields, [(2.0, 0.0, 1.0, 9.0)])
    moved = buffer.transform(cloud, "map")
    assert point_cloud2.read_points(moved).tolist() == [pytest.approx((1.0, 2.0, 1.0, 9.0))]
    assert moved.header.frame_id == "map"


def test_other_messages_are_refused(buffer):
    with pytest.raises(TypeException, match="Twist cannot be transformed, but PointStamped"):
        buffer.transform(message_type("geometry_msgs/msg/Twist")(), "map")


def test_a_missing_frame_says_that_nothing_moves_yet():
    """Before the first sample of its odometry a UAV has static frames alone."""
    fixed = TransformStamped(Header(frame_id="uav1/base_link"), "uav1/laser", Transform())
    buffer = Buffer()
    buffer.set_transform_static(fixed, "")
    with pytest.raises(LookupException, match=r"no frame 'map'.*nothing has arrived on /tf"):
        buffer.lookup_transform("map", "uav1/base_link")
    fixed.child_frame_id = "probe"
    buffer.set_transform(fixed, "")
    with pytest.raises(LookupException, match=r"no frame 'map'$"):
        buffer.lookup_transform("map", "uav1/base_link")
