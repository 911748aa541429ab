"""Tests that random streams are named, independent, and of the documented distribution."""

import numpy as np
from scipy import stats

from volery.core import rng


def draw(key, n, start=0):
    out = np.empty((1, n))
    rng.fill_normal(np.array([key]), start, out)
    return out[0]


def test_normal_numbers_are_normal():
    sample = draw(rng.stream_key(1, "uav1/imu"), 200_000)
    assert stats.kstest(sample, "norm").pvalue > 1e-3
    assert abs(stats.kurtosis(sample)) < 0.05


def test_quantile_matches_scipy_into_the_tails():
    p = np.concatenate([np.logspace(-12, -1, 200), 1.0 - np.logspace(-9, -1, 200)])
    ours = np.array([rng.normal_quantile(x) for x in p])
    np.testing.assert_allclose(ours, stats.norm.ppf(p), rtol=2e-9, atol=2e-8)


def test_streams_differ_by_name_and_seed_and_do_not_correlate():
    base = draw(rng.stream_key(1, "uav1/imu"), 50_000)
    for key in (rng.stream_key(2, "uav1/imu"), rng.stream_key(1, "uav2/imu")):
        other = draw(key, 50_000)
        assert abs(np.corrcoef(base, other)[0, 1]) < 0.02


def test_numbers_depend_on_key_and_counter_alone():
    key = rng.stream_key(7, "x")
    np.testing.assert_array_equal(draw(key, 10, 5), draw(key, 15)[5:])


def test_neighbouring_numbers_do_not_correlate():
    sample = draw(rng.stream_key(3, "y"), 100_000)
    assert abs(np.corrcoef(sample[:-1], sample[1:])[0, 1]) < 0.02


def test_uniform_stays_inside_the_open_interval():
    key = rng.stream_key(1, "u")
    numbers = np.array([rng.uniform(key, k) for k in range(10_000)])
    assert numbers.min() > 0.0
    assert numbers.max() < 1.0
    assert stats.kstest(numbers, "uniform").pvalue > 1e-3


def test_generator_is_reproducible():
    a = rng.generator(1, "trees").random(4)
    np.testing.assert_array_equal(a, rng.generator(1, "trees").random(4))
    assert not np.array_equal(a, rng.generator(1, "bushes").random(4))


def test_rows_counted_by_themselves_are_the_same_numbers():
    keys = np.array([rng.stream_key(1, "a"), rng.stream_key(1, "b")])
    out = np.empty((2, 4))
    rng.fill_normal_draws(keys, np.array([7, 0]), 9, 3, out)
    # Not to the last bit: the compiler fuses multiplications and additions for each caller anew.
    np.testing.assert_allclose(out[0], draw(keys[0], 4, 3 + 4 * 2), rtol=1e-12)
    np.testing.assert_allclose(out[1], draw(keys[1], 4, 3 + 4 * 9), rtol=1e-12)
