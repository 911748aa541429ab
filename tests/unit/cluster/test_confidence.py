"""Confidence intervals against published values."""

import math

import pytest

from volery.cluster.confidence import estimate_mean

pytest.importorskip("scipy")


def test_students_interval():
    found = estimate_mean([2.0, 4.0, 6.0, 8.0])
    assert found.mean == 5.0
    # t(0.975, 3) = 3.18245, s = 2.58199
    assert found.half_width == pytest.approx(3.18245 * 2.58199 / 2.0, rel=1e-5)


def test_wilsons_interval():
    found = estimate_mean([1.0] * 8 + [0.0] * 2)
    assert (found.low, found.high) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    certain = estimate_mean([1.0] * 20)
    assert certain.low == pytest.approx(0.8389, abs=1e-4)
    assert certain.high == pytest.approx(1.0)


def test_the_interval_covers_the_mean_as_often_as_it_says():
    import numpy as np

    random = np.random.default_rng(5)
    inside = 0
    for _ in range(400):
        found = estimate_mean(random.normal(3.0, 2.0, 6).tolist(), 0.8)
        inside += found.low <= 3.0 <= found.high
    assert 0.74 < inside / 400 < 0.86


def test_too_few_values_have_no_interval():
    assert estimate_mean([]).count == 0
    assert math.isinf(estimate_mean([3.5]).half_width)
    assert estimate_mean([1.5, math.nan, math.inf]).count == 1
