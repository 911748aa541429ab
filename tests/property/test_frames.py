"""Every change of frame is undone by its inverse and keeps what it must keep."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from volery.core import frames
from volery.core import rotations as rot

vectors = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0, allow_nan=False))
quaternions = (
    arrays(np.float64, 4, elements=st.floats(-1.0, 1.0, allow_nan=False))
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(rot.normalize)
)
PAIRS = [
    (frames.ned_from_enu, frames.enu_from_ned),
    (frames.frd_from_flu, frames.flu_from_frd),
    (frames.optical_from_flu, frames.flu_from_optical),
    (frames.unity_from_ros, frames.ros_from_unity),
    (frames.gltf_from_enu, frames.enu_from_gltf),
]


def same_rotation(p, q):
    return min(np.abs(p - q).max(), np.abs(p + q).max()) < 1e-9


@pytest.mark.parametrize(("there", "back"), PAIRS)
@given(v=vectors)
def test_round_trip_and_length(there, back, v):
    np.testing.assert_array_equal(back(there(v)), v)
    assert np.linalg.norm(there(v)) == pytest.approx(np.linalg.norm(v))


@given(quaternions, vectors)
def test_attitude_means_the_same_in_ned(q_enu_flu, v_flu):
    q_ned_frd = frames.q_ned_frd_from_enu_flu(q_enu_flu)
    expected = frames.ned_from_enu(rot.rotate(q_enu_flu, v_flu))
    np.testing.assert_allclose(
        rot.rotate(q_ned_frd, frames.frd_from_flu(v_flu)), expected, atol=1e-9
    )
    assert same_rotation(frames.q_enu_flu_from_ned_frd(q_ned_frd), q_enu_flu)


@given(quaternions, vectors)
def test_unity_rotates_the_same_things_to_the_same_places(q_ros, v_ros):
    turned_in_ros = frames.unity_from_ros(rot.rotate(q_ros, v_ros))
    turned_in_unity = rot.rotate(frames.q_unity_from_ros(q_ros), frames.unity_from_ros(v_ros))
    np.testing.assert_allclose(turned_in_unity, turned_in_ros, atol=1e-9)
    assert same_rotation(frames.q_ros_from_unity(frames.q_unity_from_ros(q_ros)), q_ros)


def test_unity_convention_of_its_own_connector():
    # Unity: x right, y up, z forward; ROS: x forward, y left, z up.
    np.testing.assert_array_equal(frames.unity_from_ros([1.0, 0.0, 0.0]), [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(frames.unity_from_ros([0.0, 1.0, 0.0]), [-1.0, 0.0, 0.0])
    np.testing.assert_array_equal(frames.unity_from_ros([0.0, 0.0, 1.0]), [0.0, 1.0, 0.0])
    # ROS (x, y, z) = Unity (z, -x, y)
    np.testing.assert_array_equal(frames.ros_from_unity([1.0, 2.0, 3.0]), [3.0, -1.0, 2.0])


def test_unity_handedness_turns_the_sense_of_yaw():
    left_turn_ros = rot.from_rpy(0.0, 0.0, np.pi / 2)
    q = frames.q_unity_from_ros(left_turn_ros)
    # Facing forward (Unity +z), a left turn ends facing Unity -x.
    np.testing.assert_allclose(rot.rotate(q, [0.0, 0.0, 1.0]), [-1.0, 0.0, 0.0], atol=1e-12)


def test_optical_axes():
    np.testing.assert_array_equal(frames.optical_from_flu([1.0, 0.0, 0.0]), [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(frames.optical_from_flu([0.0, -1.0, 0.0]), [1.0, 0.0, 0.0])
    forward = rot.rotate(frames.Q_BODY_OPTICAL, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(forward, [1.0, 0.0, 0.0], atol=1e-12)


def test_north_and_nose():
    np.testing.assert_array_equal(frames.ned_from_enu([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0])
    facing_east_enu = rot.IDENTITY
    q = frames.q_ned_frd_from_enu_flu(facing_east_enu)
    assert rot.yaw_of(q) == pytest.approx(np.pi / 2)  # east is +90 deg from north


@given(quaternions, vectors)
def test_rotation_means_the_same_in_gltf(q, v):
    expected = frames.gltf_from_enu(rot.rotate(q, v))
    got = rot.rotate(frames.q_gltf_from_enu(q), frames.gltf_from_enu(v))
    np.testing.assert_allclose(got, expected, atol=1e-9)
