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
    (frames.ned_of_enu, frames.enu_of_ned),
    (frames.frd_of_flu, frames.flu_of_frd),
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
    q_ned_frd = frames.q_ned_frd_of_enu_flu(q_enu_flu)
    expected = frames.ned_of_enu(rot.rotate(q_enu_flu, v_flu))
    np.testing.assert_allclose(rot.rotate(q_ned_frd, frames.frd_of_flu(v_flu)), expected, atol=1e-9)
    assert same_rotation(np.array(frames.q_enu_flu_of_ned_frd(q_ned_frd)), q_enu_flu)


def test_north_and_nose():
    np.testing.assert_array_equal(frames.ned_of_enu([0.0, 1.0, 0.0]), [1.0, 0.0, 0.0])
    facing_east_enu = rot.IDENTITY
    q = frames.q_ned_frd_of_enu_flu(facing_east_enu)
    assert rot.yaw_of(q) == pytest.approx(np.pi / 2)  # east is +90 deg from north


@given(quaternions, vectors)
def test_rotation_means_the_same_in_gltf(q, v):
    expected = frames.gltf_from_enu(rot.rotate(q, v))
    got = rot.rotate(frames.q_gltf_from_enu(q), frames.gltf_from_enu(v))
    np.testing.assert_allclose(got, expected, atol=1e-9)
