import numpy as np
import pytest

from volery.core.compiled import kernel
from volery.core.simd import (
    LANES,
    any_outside,
    lanes_at,
    magnitudes,
    no_lanes,
    not_negative,
    put_lanes,
    roots,
    totals,
    where_negative,
)

A = np.array([1.5, -2.0, 0.0, 7.25, -0.5, 3.0])
B = np.array([4.0, 0.25, -1.0, 2.0, 8.0, -6.0])


@kernel
def _calculate(a, b, out):
    for first in range(0, len(a), LANES):
        x, y = lanes_at(a, first), lanes_at(b, first)
        put_lanes(out[0], first, x + y * 2.0)
        put_lanes(out[1], first, 3.0 - x * y)
        put_lanes(out[2], first, roots(magnitudes(y)))
        put_lanes(out[3], first, not_negative(x))
        put_lanes(out[4], first, where_negative(x, y, 10.0 * x))


@kernel
def _sum(a, b):
    x = y = no_lanes()
    for first in range(0, len(a), LANES):
        x += lanes_at(a, first)
        y -= lanes_at(b, first)
    return totals(x, y)


@kernel
def _is_outside(a, low, high):
    return any_outside(lanes_at(a, 0), lanes_at(low, 0), high)


def test_lanes_calculate_element_by_element():
    out = np.zeros((5, len(A)))
    _calculate(A, B, out)
    expected = [
        A + 2.0 * B,
        3.0 - A * B,
        np.sqrt(np.abs(B)),
        np.maximum(A, 0.0),
        np.where(A < 0.0, B, 10.0 * A),
    ]
    np.testing.assert_array_equal(out, expected)


def test_totals_are_the_sums_over_the_lanes():
    assert _sum(A, B) == (A.sum(), -B.sum())


@pytest.mark.parametrize("lane", range(LANES))
def test_one_lane_outside_is_enough(lane):
    values = np.zeros(LANES)
    low = np.full(LANES, -1.0)
    assert not _is_outside(values, low, 1.0)
    for beyond in (-1.5, 1.5, np.nan):
        values[lane] = beyond
        assert _is_outside(values, low, 1.0)
