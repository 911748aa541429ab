from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.core import rotations
from volery.core.rotation_kernels import moved_points
from volery.core.rows import in_one_piece
from volery.core.vectors import norm

_NUMBERS = st.floats(-1e3, 1e3, allow_subnormal=False)


@given(st.lists(_NUMBERS, min_size=1, max_size=4))
def test_the_norm_is_the_length(numbers: list[float]) -> None:
    assert norm(np.array(numbers)) == pytest.approx(float(np.linalg.norm(numbers)), rel=1e-15)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_has_no_finite_length(bad: float) -> None:
    assert not np.isfinite(norm(np.array([1.0, bad, 2.0])))


@given(st.integers(0, 2**32 - 1))
def test_one_rotation_is_to_the_bit_what_it_is_among_many(seed: int) -> None:
    random = np.random.default_rng(seed)
    p, q = (rotations.normalize(random.normal(size=(5, 4))) for _ in range(2))
    v = random.normal(size=(5, 3))
    products, turned = rotations.multiply(p, q), rotations.rotate(p, v)
    turns, matrices = rotations.exponential(v), rotations.matrix(p)
    for i in range(5):
        assert rotations.matrix(p[i]).tolist() == matrices[i].tolist()
        np.testing.assert_allclose(matrices[i] @ v[i], turned[i], atol=1e-14)
        assert rotations.multiply(p[i], q[i]).tolist() == products[i].tolist()
        assert rotations.rotate(p[i], v[i]).tolist() == turned[i].tolist()
        assert rotations.exponential(v[i]) == pytest.approx(turns[i], abs=1e-15)


def test_points_are_moved_as_vectors_are() -> None:
    random = np.random.default_rng(3)
    attitude, position = rotations.normalize(random.normal(size=4)), random.normal(size=3)
    points = random.normal(size=(20, 3))
    expected = rotations.rotate(attitude, points) + position
    assert moved_points(points, attitude, position).tolist() == expected.tolist()
    assert moved_points(points[:0], attitude, position).shape == (0, 3)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [([0, 1, 2], slice(0, 3)), ([4], slice(4, 5)), ([], slice(0, 0))],
)
def test_rows_in_one_piece_are_a_slice(rows: list[int], expected: slice) -> None:
    assert in_one_piece(np.array(rows, np.int64)) == expected


@pytest.mark.parametrize("rows", [[0, 2], [2, 1], [1, 1], [0, 1, 3]])
def test_other_rows_stay_numbers(rows: list[int]) -> None:
    table = np.arange(10)
    taken = in_one_piece(np.array(rows, np.int64))
    assert not isinstance(taken, slice)
    assert table[taken].tolist() == rows
