import numpy as np
import pytest

from volery.core import rotations
from volery.core.compiled import kernel
from volery.core.rotation_kernels import matrix_rows, quaternion_product
from volery.vehicle.compiled import fused_kernel
from volery.vehicle.rotation_math import matrix_of, product, turned


@fused_kernel
def _matrix_and_turn(q, h):
    return matrix_of(q[0], q[1], q[2], q[3]), turned(q[0], q[1], q[2], q[3], h[0], h[1], h[2])


@fused_kernel
def _fused_product(p, q):
    return product(p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3])


@kernel
def _product_and_rows(p, q):
    return (
        quaternion_product(p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3]),
        matrix_rows(q[0], q[1], q[2], q[3]),
    )


def test_rigid_body_words_agree_with_the_rotations():
    rng = np.random.default_rng(3)
    for _ in range(50):
        q = rotations.normalize(rng.normal(size=4))
        h = rng.normal(size=3) * 0.02
        matrix, after = _matrix_and_turn(q, h)
        np.testing.assert_allclose(np.reshape(matrix, (3, 3)), rotations.matrix(q), atol=1e-14)
        wanted = rotations.multiply(q, rotations.exponential(2.0 * h))
        np.testing.assert_allclose(after, wanted, atol=1e-11)


def test_products_agree_with_the_rotations():
    rng = np.random.default_rng(4)
    for _ in range(50):
        p, q = rotations.normalize(rng.normal(size=(2, 4)))
        wanted = rotations.multiply(p, q)
        exact, rows = _product_and_rows(p, q)
        assert list(exact) == wanted.tolist()
        assert np.array(rows).tolist() == rotations.matrix(q).tolist()
        np.testing.assert_allclose(_fused_product(p, q), wanted, atol=1e-15)


def test_parts_refuse_python_before_and_after_compilation():
    _matrix_and_turn(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    with pytest.raises(TypeError, match="only kernels can call it"):
        matrix_of(0.0, 0.0, 0.0, 1.0)
