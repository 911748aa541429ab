"""Rotations obey the axioms of their group and agree with matrices and scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from volery.core import rotations as rot

components = st.floats(-1.0, 1.0, allow_nan=False)
quaternions = (
    arrays(np.float64, 4, elements=components)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(rot.normalize)
)
vectors = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0, allow_nan=False))


def same_rotation(p, q, tolerance=1e-9):
    return min(np.abs(p - q).max(), np.abs(p + q).max()) < tolerance


@given(quaternions, quaternions, quaternions)
def test_composition_is_associative(p, q, r):
    left = rot.multiply(rot.multiply(p, q), r)
    assert same_rotation(left, rot.multiply(p, rot.multiply(q, r)))


@given(quaternions)
def test_inverse_and_identity(q):
    assert same_rotation(rot.multiply(q, rot.conjugate(q)), rot.IDENTITY)
    assert same_rotation(rot.multiply(q, rot.IDENTITY), q)


@given(quaternions, quaternions, vectors)
def test_acting_twice_is_acting_with_the_product(p, q, v):
    np.testing.assert_allclose(
        rot.rotate(rot.multiply(p, q), v), rot.rotate(p, rot.rotate(q, v)), atol=1e-9
    )


@given(quaternions, vectors)
def test_lengths_are_kept_and_scipy_agrees(q, v):
    turned = rot.rotate(q, v)
    np.testing.assert_allclose(np.linalg.norm(turned), np.linalg.norm(v), atol=1e-9)
    np.testing.assert_allclose(turned, Rotation.from_quat(q).apply(v), atol=1e-9)
    np.testing.assert_allclose(rot.matrix(q) @ v, turned, atol=1e-9)


@given(quaternions)
def test_exponential_undoes_logarithm(q):
    assert same_rotation(rot.exponential(rot.logarithm(q)), q)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_roll_pitch_yaw_are_fixed_axis_angles(roll, pitch, yaw):
    q = rot.from_rpy(roll, pitch, yaw)
    assert same_rotation(q, Rotation.from_euler("xyz", [roll, pitch, yaw]).as_quat())
    assert same_rotation(rot.from_rpy(*rot.to_rpy(q)), q, 1e-7)


@given(arrays(np.float64, 3, elements=st.floats(-3.1, 3.1)))
def test_a_yaw_alone_is_a_roll_and_pitch_of_zero_to_the_byte(yaw):
    assert rot.from_yaw(yaw).tobytes() == rot.from_rpy(0.0, 0.0, yaw).tobytes()
    assert rot.from_yaw(yaw[0]).tobytes() == rot.from_rpy(0.0, 0.0, yaw[0]).tobytes()


@given(
    arrays(np.float64, (3, 4), elements=components), arrays(np.float64, (3, 4), elements=components)
)
def test_arrays_give_what_single_vectors_give_to_the_byte(q, p):
    """Kernels compute arrays, Python single vectors; both serve the same flights."""
    v = p[:, :3]
    q.flags.writeable = False
    for turned in (rot.rotate(q, v), rot.rotate(q[:, None], v[None])[[0, 1, 2], [0, 1, 2]]):
        assert turned.tobytes() == np.array([rot.rotate(q[k], v[k]) for k in range(3)]).tobytes()
    alone = np.array([rot.rotate(q[0], v[k]) for k in range(3)])
    assert (
        rot.rotate(q[0], v).tobytes() == rot.rotate(q[:1], v[:, ::1]).tobytes() == alone.tobytes()
    )
    assert rot.rotate(q, v[0])[2].tobytes() == rot.rotate(q[2], v[0]).tobytes()
    both = np.array([rot.multiply(p[k], q[k]) for k in range(3)])
    assert rot.multiply(p, q).tobytes() == both.tobytes()
    assert rot.multiply(p[0], q)[2].tobytes() == rot.multiply(p[0], q[2]).tobytes()


def test_functions_broadcast_over_leading_axes():
    q = rot.from_rpy(np.zeros((5, 2)), 0.1, 0.2)
    assert q.shape == (5, 2, 4)
    assert rot.rotate(q, np.ones(3)).shape == (5, 2, 3)
    assert rot.rotate(q[:, None], np.ones((1, 7, 1, 3))).shape == (5, 7, 2, 3)
    assert rot.rotate(q[:0], np.ones(3)).shape == (0, 2, 3)
    for wrong in ((q[..., :3], np.ones(3)), (q, np.ones((2, 4))), (q, np.ones((3, 3)))):
        with pytest.raises(ValueError, match="shape"):
            rot.rotate(*wrong)
    assert rot.matrix(q).shape == (5, 2, 3, 3)
    assert rot.yaw_of(q).shape == (5, 2)
