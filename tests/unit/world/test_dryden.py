"""Dryden turbulence against MIL-F-8785C: intensities, spectra, axes, independence."""

import numpy as np
import pytest
from air_probe import TICK_S, air_at
from scipy.signal import welch

from volery.core.compiled import kernel
from volery.world.weather import W20_M_S, Weather
from volery.world.weather.dryden import new_turbulence, turbulent_velocity


@kernel
def _record(filters, w20, height, wind, out, period):
    """One UAV that hovers in a wind along x: `out` (N, 3)."""
    for t in range(len(out)):
        out[t, 0], out[t, 1], out[t, 2] = turbulent_velocity(
            filters[0], w20, height, wind, 0.0, 0.0, -wind, 0.0, 0.0, t, period
        )


def record(height, wind, level, ticks, period=TICK_S):
    out = np.empty((ticks, 3))
    _record(new_turbulence(1, ["uav1"]), W20_M_S[level], height, wind, out, period)
    return out


def lengths_and_intensities(height_m, level):
    """(Lu, Lw, su, sw) in m and m/s, written from the standard."""
    knots = {"light": 15, "moderate": 30, "severe": 45}[level]
    feet = min(max(height_m / 0.3048, 10.0), 1000.0)
    k = 0.177 + 0.000823 * feet
    vertical = 0.1 * knots * 1852 / 3600
    return 0.3048 * feet / k**1.2, 0.3048 * feet, vertical / k**0.4, vertical


def spectrum(f, speed, length, intensity, longitudinal):
    """One-sided PSD in (m/s)^2/Hz."""
    x2 = (2 * np.pi * f * length / speed) ** 2
    shape = 2.0 / (1 + x2) if longitudinal else (1 + 3 * x2) / (1 + x2) ** 2
    return 2.0 * length / speed * intensity**2 * shape


def test_published_intensities():
    lu, lw, su, sw = lengths_and_intensities(50.0, "light")
    assert (su, sw) == (pytest.approx(1.23, abs=5e-3), pytest.approx(0.772, abs=5e-4))
    assert (lu, lw) == (pytest.approx(202.3, abs=0.1), 50.0)
    assert lengths_and_intensities(304.8, "light")[0] == pytest.approx(304.8)  # isotropic there


@pytest.mark.parametrize("height", [1.0, 10.0, 50.0, 304.8, 900.0])
@pytest.mark.parametrize("level", ["light", "severe"])
def test_intensities_of_many_uavs(height, level):
    """20,000 UAVs at one instant, as they begin and 4 s later: standard deviations within 2 %."""
    count = 20_000
    filters = new_turbulence(7, [f"uav{i}" for i in range(count)])
    wind = Weather((10, 0, 0), w20_m_s=W20_M_S[level])
    _, _, su, sw = lengths_and_intensities(height, level)
    for tick in (0, 1, 500):
        got = air_at(wind, [0, 0, height], tick=np.full(count, tick), filters=filters)
        got -= [10, 0, 0]
        np.testing.assert_allclose(got.std(axis=0), [su, su, sw], rtol=0.02)
        assert np.abs(got.mean(axis=0) / [su, su, sw]).max() < 0.03
        correlations = np.corrcoef(got.T)[np.triu_indices(3, 1)]
        assert np.abs(correlations).max() < 0.03


@pytest.mark.parametrize(
    ("height", "wind", "level"),
    [(50.0, 10.0, "light"), (3.1, 30.0, "severe"), (20.0, 0.2, "moderate")],
)
def test_spectra(height, wind, level):
    """Welch's estimate of 3.3 h of air, held from tick to tick, octave by octave: within 8 %."""
    lu, lw, su, sw = lengths_and_intensities(height, level)
    air = record(height, wind, level, 1_500_000)
    held = np.repeat(air[:200_000], 8, axis=0)
    slow = welch(air, 1 / TICK_S, nperseg=2**16, axis=0)
    fast = welch(held, 8 / TICK_S, nperseg=2**14, axis=0)
    speed = max(wind, 1.0)
    for column, (length, intensity) in enumerate([(lu, su), (lu, su), (lw, sw)]):
        for f0 in (0.1, 0.2, 0.5, 1.0, 2.0, 10.0, 40.0, 80.0):
            f, power = slow if f0 < 2.0 else fast
            near = (f > f0 / 2**0.5) & (f < f0 * 2**0.5)
            wanted = spectrum(f[near], speed, length, intensity, column == 0)
            ratio = (power[near, column] / wanted).mean()
            assert ratio == pytest.approx(1.0, abs=0.08), (column, f0)


def test_the_longitudinal_axis_lies_along_the_wind():
    """In a wind to the north-east u and v are the sum and difference of east and north."""
    tick = np.arange(200)
    names = ["uav1"]
    along_x, diagonal, calm = (
        np.array(
            [
                air_at(weather, [0, 0, 30], tick=[t], velocity=v, filters=filters)[0]
                - weather.velocity_map
                for t in tick
            ]
        )
        for weather, v, filters in (
            (Weather((5, 0, 0), w20_m_s=9.0), (0, 0, 0), new_turbulence(3, names)),
            (Weather((3, 4, 0), w20_m_s=9.0), (0, 0, 0), new_turbulence(3, names)),
            (Weather(w20_m_s=9.0), (0, -5, 0), new_turbulence(3, names)),
        )
    )
    u, v, w = along_x.T
    np.testing.assert_allclose(diagonal, np.stack([0.6 * u - 0.8 * v, 0.8 * u + 0.6 * v, w], 1))
    # without wind it lies along the flight through the air
    np.testing.assert_allclose(calm, np.stack([v, -u, w], 1), atol=1e-12)


def test_a_turn_of_the_flight_does_not_make_the_air_jump():
    """Calm air, 5 m/s first east, then north, then back: increments stay those of a tick."""
    filters = new_turbulence(5, ["uav1"])
    velocities = np.repeat([[5.0, 0, 0], [0, 5, 0], [0, -5, 0], [-4, 3, 0]], 250, axis=0)
    weather = Weather(w20_m_s=W20_M_S["severe"])
    air = np.array(
        [
            air_at(weather, [0, 0, 30], tick=[t], velocity=v, filters=filters)[0]
            for t, v in enumerate(velocities)
        ]
    )
    lu, lw, su, sw = lengths_and_intensities(30.0, "severe")
    steps = np.abs(np.diff(air, axis=0))
    usual = [su * np.sqrt(3 * 5 * TICK_S / lu)] * 2 + [sw * np.sqrt(3 * 5 * TICK_S / lw)]
    assert (steps < 5.0 * np.array(usual)).all()


def test_streams_follow_seed_and_name_alone():
    weather = Weather((8, 0, 0), w20_m_s=10.0)
    alone = air_at(weather, [0, 0, 20], tick=[4], filters=new_turbulence(1, ["uav2"]))
    three = air_at(
        weather, [0, 0, 20], tick=[4] * 3, filters=new_turbulence(1, ["uav1", "uav2", "x"])
    )
    np.testing.assert_array_equal(alone[0], three[1])
    assert len(np.unique(three[:, 0])) == 3
    other = air_at(weather, [0, 0, 20], tick=[4], filters=new_turbulence(2, ["uav2"]))
    assert (other != alone).all()
