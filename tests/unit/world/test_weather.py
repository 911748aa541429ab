"""Mean wind, fields and gusts against their formulas; what a weather refuses."""

import numpy as np
import pytest
from air_probe import TICK_S, air_at

from volery.core.errors import CommandError
from volery.world.terrain import Terrain
from volery.world.weather import CALM, Gust, LogProfile, PowerProfile, Weather, WindField

SLOPE = Terrain.from_heights([[0.0, 30.0], [0.0, 30.0]], 100.0)
"""0.3 m up for each m east."""


def test_steady_wind_is_the_same_everywhere():
    positions = np.random.default_rng(0).uniform(-500, 500, (20, 3))
    np.testing.assert_array_equal(
        air_at(Weather((3, -2, 0.5)), positions), np.tile([3, -2, 0.5], (20, 1))
    )
    assert not air_at(CALM, positions).any()


@pytest.mark.parametrize("height", [0.02, 0.03, 0.5, 10.0, 120.0, 304.8])
def test_log_profile_counts_from_the_ground(height):
    wind = Weather((6, 3, -1), LogProfile(reference_height_m=10.0, roughness_m=0.03))
    factor = max(np.log(height / 0.03), 0.0) / np.log(10.0 / 0.03)
    got = air_at(wind, [40.0, 50.0, 12.0 + height], terrain=SLOPE)
    np.testing.assert_allclose(got[0], factor * np.array([6, 3, -1]), atol=1e-12)


@pytest.mark.parametrize("height", [0.0, 2.0, 10.0, 304.8])
def test_power_profile_counts_from_the_ground(height):
    wind = Weather((6, 0, 0), PowerProfile(reference_height_m=20.0, exponent=0.25))
    got = air_at(wind, [40.0, 50.0, 12.0 + height], terrain=SLOPE)
    assert got[0, 0] == pytest.approx(6.0 * (height / 20.0) ** 0.25, abs=1e-6)


@pytest.mark.parametrize("profile", [LogProfile(), PowerProfile()])
def test_profiles_end_at_the_ground_and_at_1000_feet(profile):
    below, top, above = air_at(
        Weather((5, 0, 0), profile), [[0, 0, -3], [0, 0, 304.8], [0, 0, 900]]
    )
    assert not below.any()
    np.testing.assert_array_equal(top, above)


# ------------------------------------------------------------------------------------------ fields


def linear(positions):
    x, y, z = np.asarray(positions, float).T
    return np.stack([1 + 0.02 * x - 0.01 * y + 0.1 * z, 0.03 * y - 2, 0.05 * z - 0.01 * x], axis=-1)


def field_of(function, shape=(4, 5, 6), origin=(-20.0, 10.0, 0.0), spacing=(10.0, 20.0, 5.0)):
    k, j, i = np.indices(shape)
    positions = np.stack([i, j, k], axis=-1) * spacing + origin
    return WindField(function(positions.reshape(-1, 3)).reshape(*shape, 3), origin, spacing)


def test_a_linear_field_is_met_exactly():
    positions = np.random.default_rng(1).uniform([-20, 10, 0], [30, 90, 15], (200, 3))
    got = air_at(Weather(field=field_of(linear)), positions)
    np.testing.assert_allclose(got, linear(positions), atol=1e-12)


def test_a_trilinear_field_is_met_exactly_within_a_cell():
    def product(positions):
        x, y, z = positions.T
        return np.stack([x * y * z, x * y, y * z], axis=-1)

    cube = field_of(product, (2, 2, 2), (0.0, 0.0, 0.0), (2.0, 3.0, 4.0))
    positions = np.random.default_rng(2).uniform(0, [2, 3, 4], (50, 3))
    np.testing.assert_allclose(
        air_at(Weather(field=cube), positions), product(positions), atol=1e-12
    )


def test_a_field_is_clamped_at_its_border():
    positions = np.random.default_rng(3).uniform(-200, 200, (200, 3))
    got = air_at(Weather(field=field_of(linear)), positions)
    inside = np.clip(positions, [-20, 10, 0], [30, 90, 15])
    np.testing.assert_allclose(got, linear(inside), atol=1e-12)


def test_a_field_of_one_layer_is_constant_along_that_axis():
    flat = field_of(linear, shape=(1, 3, 1))
    got = air_at(Weather(field=flat), [[-500, 30, 900], [70, 30, -9]])
    np.testing.assert_allclose(got, linear([[-20, 30, 0]] * 2), atol=1e-12)


# ------------------------------------------------------------------------------------------- gusts


def shape_of(t, rise, length):
    """The 1-cosine rise, the plateau, and the same fall."""
    up = 0.5 * (1 - np.cos(np.pi * np.clip(t / rise, 0, 1)))
    down = 0.5 * (1 - np.cos(np.pi * np.clip((length - t) / rise, 0, 1)))
    return np.minimum(up, down)


@pytest.mark.parametrize("length", [np.inf, 3.0, 1.6])
def test_one_minus_cosine(length):
    gust = Gust((4.0, -2.0, 1.0), 2.0, 0.8, 2.0 + length)
    tick = np.arange(0, 900)
    got = air_at(Weather(gusts=(gust,)), [9, 9, 9], tick=tick)
    t = (tick + 0.5) * TICK_S - 2.0
    wanted = np.outer(shape_of(t, 0.8, length), [4, -2, 1])
    np.testing.assert_allclose(got, wanted, atol=1e-12)
    assert np.abs(got).max() == pytest.approx(4.0, abs=1e-3)


def test_gusts_and_wind_add_up():
    a, b = Gust((1, 0, 0), 0.0, 0.5), Gust((0, 3, -1), 0.3, 1.0, 4.0)
    tick = np.arange(700)
    parts = [air_at(Weather(gusts=(g,)), [0, 0, 5], tick=tick) for g in (a, b)]
    both = air_at(Weather((2, 0, 0), gusts=(a, b)), [0, 0, 5], tick=tick)
    np.testing.assert_allclose(both, parts[0] + parts[1] + [2, 0, 0], atol=1e-12)


def test_a_front_reaches_positions_one_after_the_other():
    """5 m/s: 25 m downwind it is 5 s = 625 ticks late, across the wind it is on time."""
    front = Weather(gusts=(Gust((4, 0, 0), 1.0, 0.8, 3.0, front_velocity_map=(3, 4, 0)),))
    tick = np.arange(400)
    here = air_at(front, [0, 0, 7], tick=tick)
    np.testing.assert_allclose(air_at(front, [15, 20, 7], tick=tick + 625), here, atol=1e-12)
    np.testing.assert_allclose(air_at(front, [-8, 6, 99], tick=tick), here, atol=1e-12)
    assert here[:, 0].max() == pytest.approx(4.0)


def test_adding_a_gust_drops_those_that_are_over():
    over, front, stays = (
        Gust((1, 0, 0), 0.0, 1.0, 5.0),
        Gust((1, 0, 0), 0.0, 1.0, 5.0, (2, 0, 0)),
        Gust((1, 0, 0), 0.0, 1.0),
    )
    weather = Weather((1, 0, 0), gusts=(over, front, stays))
    new = Gust((2, 0, 0), 6.0, 1.0)
    assert weather.with_gust(new, 4.9).gusts == (over, front, stays, new)
    assert weather.with_gust(new, 5.0).gusts == (front, stays, new)
    assert weather.with_gust(new, 5.0).velocity_map == (1, 0, 0)


# ----------------------------------------------------------------------------------------- refusals


GUST = Gust((1, 0, 0), 0.0, 1.0)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Weather((61, 0, 0)), r"velocity_map .*\+-60 m/s"),
        (lambda: Weather((np.nan, 0, 0)), "velocity_map .* out of range"),
        (lambda: Weather((1, 2)), r"shape \(3,\), not \(2,\)"),
        (lambda: Weather(("a", 0, 0)), "three numbers"),
        (lambda: Weather(w20_m_s=-1), "w20_m_s = -1 .* 0 to 60"),
        (lambda: Weather(gusts=(GUST,) * 65), "65 gusts; at most 64"),
        (lambda: Weather((1, 0, 0), field=field_of(linear)), "replaces velocity_map"),
        (lambda: Weather(profile=LogProfile(), field=field_of(linear)), "replaces velocity_map"),
        (lambda: LogProfile(roughness_m=0.0), "roughness_m = 0"),
        (lambda: LogProfile(1.0, 0.9), "twice roughness_m"),
        (lambda: PowerProfile(exponent=2.0), "exponent = 2 .* 0 to 1"),
        (lambda: Gust((1, 0, 0), 0.0, 0.0), "rise_s = 0"),
        (lambda: Gust((1, 0, 0), np.nan, 1.0), "start_s = nan"),
        (lambda: Gust((1, 0, 0), 0.0, 1.0, 1.9), "end_s .* start_s"),
        (lambda: Gust((1, 0, 0), 0.0, 1.0, np.nan), "end_s .* start_s"),
        (lambda: Gust((1, 0, 0), 0.0, 1.0, 9.0, (0.01, 0, 0)), "at least 0.1 m/s"),
        (lambda: WindField(np.zeros((2, 2, 3)), (0, 0, 0), (1, 1, 1)), r"\(Z, Y, X, 3\)"),
        (lambda: WindField(np.full((2, 2, 2, 3), 99), (0, 0, 0), (1, 1, 1)), "60 m/s"),
        (lambda: WindField(np.zeros((2, 2, 2, 3)), (0, 0, 0), (1, 0, 1)), "positive"),
        (lambda: WindField(np.zeros((2, 2, 2, 3)), (0, np.inf, 0), (1, 1, 1)), "origin_map"),
    ],
)
def test_refusals(build, words):
    with pytest.raises(CommandError, match=words):
        build()
