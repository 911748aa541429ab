"""Light, haze, rain and snow in images, against Koschmieder's law and counts of particles."""

import math

import numpy as np
import pytest
from scipy import integrate
from test_camera import NOON, SMALL, render, wall

from volery.core.workers import Workers
from volery.sensors.cameras.camera import _linear
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.cameras.precipitation import falling_in
from volery.sensors.cameras.weather_light import LightOfTheHour, light_in
from volery.world.materials import Material
from volery.world.weather import CLEAR_AIR, Particles, Weather

__all__ = ["render"]
RAIN = Weather(particles=Particles(rain_mm_h=40.0))
SNOW = Weather(particles=Particles(snow_mm_h=4.0))
PLAIN = {"read_noise": 0.0, "shot_noise": 0.0}


def light_of(pixels):
    """Linear light of bytes."""
    return _linear()[pixels].astype(float)


def test_clear_air_leaves_the_light_alone():
    assert light_in(NOON, CLEAR_AIR) is NOON
    assert falling_in(Weather(), NOON) == ()


@pytest.mark.parametrize(
    "particles", [Particles(fog_visibility_m=60.0), Particles(dust_visibility_m=90.0)]
)
def test_contrast_fades_as_koschmieder_says(render, particles):
    """What a wall differs from the haze by falls off with exp(-a d)."""
    light = light_in(make_light(40.0, visibility_m=1e6), particles)
    haze = np.minimum(light.horizon, 1.0)
    contrasts = []
    for distance in (5.0, 15.0, 30.0):
        seen = render(SMALL, (0.0, 0.0, 20.0), solids=[wall(distance)], light=light)
        contrasts.append((light_of(seen.colour[0, 20:28, 28:36]).mean(axis=(0, 1)) - haze)[0])
    a = math.log(20.0) / particles.visibility_m
    assert contrasts[1] / contrasts[0] == pytest.approx(math.exp(-a * 10.0), rel=0.1)
    assert contrasts[2] / contrasts[0] == pytest.approx(math.exp(-a * 25.0), rel=0.15)


@pytest.mark.parametrize("weather", [RAIN, SNOW], ids=["rain", "snow"])
def test_under_clouds_no_sun_and_a_quarter_of_the_light(weather):
    light = light_in(NOON, weather.particles)
    assert (light.sun_colour == 0.0).all()
    luminance = np.array([0.2126, 0.7152, 0.0722])
    whole = luminance @ (NOON.sun_colour + NOON.overhead)
    assert luminance @ light.overhead == pytest.approx(0.25 * whole, rel=0.01)
    assert luminance @ light.zenith == pytest.approx(3.0 * luminance @ light.horizon, rel=1e-3)


def test_thin_fog_leaves_some_of_the_sun_and_thick_fog_none():
    sun = [
        light_in(NOON, Particles(fog_visibility_m=v)).sun_colour[0] / NOON.sun_colour[0]
        for v in (1000.0, 200.0, 30.0)
    ]
    np.testing.assert_allclose(sun, np.exp(-math.log(20.0) * 100.0 / np.array([1e3, 200, 30])))


def test_rain_wets_the_ground_but_not_the_leaves():
    wet = light_in(NOON, RAIN.particles).surface
    np.testing.assert_allclose(wet[Material.GROUND, :6], NOON.surface[Material.GROUND, :6] / 1.5)
    np.testing.assert_array_equal(wet[Material.LEAF], NOON.surface[Material.LEAF])
    np.testing.assert_array_equal(light_in(NOON, SNOW.particles).surface, NOON.surface)


def test_the_hour_moves_the_sun():
    angles = {None: (50.0, 135.0), 12.0: (66.0, 180.0), 18.0: (20.0, 280.0)}
    light = LightOfTheHour(lambda weather: angles[weather.hour_of_day], 20_000.0)
    noon = light(Weather(hour_of_day=12.0))
    assert noon.sun[2] == pytest.approx(math.sin(math.radians(66.0)), rel=1e-6)
    assert light(Weather(hour_of_day=12.0)) is noon
    assert light(Weather(hour_of_day=18.0)).sun[0] < 0.0  # west
    assert light(Weather()).sun[2] == pytest.approx(math.sin(math.radians(50.0)), rel=1e-6)


def black_light(colour=1.0):
    """Light that shows nothing but what falls."""
    dark = np.zeros(3, np.float32)
    light = make_light(visibility_m=1e6)
    names = ("sun_colour", "zenith", "horizon", "bounce", "overhead")
    return light._replace(**dict.fromkeys(names, dark))


def white(weather, light):
    return tuple(
        kind._replace(colour=np.ones(3, np.float32)) for kind in falling_in(weather, light)
    )


@pytest.mark.parametrize("exposure_s", [5e-4, 5e-3])
@pytest.mark.parametrize("weather", [RAIN, SNOW], ids=["rain", "snow"])
def test_light_of_what_falls_is_that_of_its_cross_section(render, weather, exposure_s):
    """On the mean a pixel shows the cross-section of all that is in its view, at any exposure."""
    light = black_light()
    (kind,) = white(weather, light)
    model = CameraModel(width=320, height=240, exposure_time_s=exposure_s)
    number = kind.cell_m**-3.0 * kind.slope * math.exp(kind.slope * kind.min_mm)

    def area(diameter):
        return number * math.exp(-kind.slope * diameter) * math.pi / 4.0 * (1e-3 * diameter) ** 2

    fraction = integrate.quad(area, kind.min_mm, kind.min_mm + 11.8 / kind.slope)[0]
    fraction *= kind.max_range_m - 0.3
    seen = render(model, (0.0, 0.0, 50.0), (0.0, -0.3, 0.0), light=light, falling=(kind,))
    assert light_of(seen.colour).mean() == pytest.approx(fraction, rel=0.15)


def test_longer_exposures_leave_longer_and_fainter_streaks(render):
    light = black_light()
    brightest, lit = [], []
    for exposure_s in (2e-4, 2e-3, 2e-2):
        model = CameraModel(width=320, height=240, exposure_time_s=exposure_s)
        seen = render(model, (0.0, 0.0, 50.0), light=light, falling=white(RAIN, light))
        colour = light_of(seen.colour[0, ..., 0])
        brightest.append(np.quantile(colour[colour > 0.0], 0.99))
        lit.append((colour > 0.0).mean())
    assert brightest[0] > brightest[1] > brightest[2]
    assert lit[0] < lit[1] < lit[2]


def test_nothing_falls_before_what_is_nearer(render):
    light = light_in(NOON, SNOW.particles)
    falling = falling_in(SNOW, light)
    behind = render(SMALL, solids=[wall(0.29)], light=light, falling=falling)
    plain = render(SMALL, solids=[wall(0.29)], light=light)
    np.testing.assert_array_equal(behind.colour, plain.colour)
    before = render(SMALL, solids=[wall(6.0)], light=light, falling=falling)
    assert (before.colour != render(SMALL, solids=[wall(6.0)], light=light).colour).any()


def test_depth_and_labels_know_nothing_of_the_weather(render):
    light = light_in(NOON, SNOW.particles)
    falling = falling_in(SNOW, light)
    snowy, clear = render(SMALL, light=light, falling=falling), render(SMALL)
    np.testing.assert_array_equal(snowy.depth, clear.depth)
    np.testing.assert_array_equal(snowy.material, clear.material)
    alone = render(SMALL, light=light, falling=falling, parts=("colour",))
    assert alone.depth is None
    np.testing.assert_array_equal(alone.colour, snowy.colour)


def test_images_do_not_depend_on_threads(render):
    light = light_in(NOON, SNOW.particles)
    images = [
        render(SMALL, light=light, falling=falling_in(SNOW, light), workers=Workers(n)).colour
        for n in (1, 3)
    ]
    np.testing.assert_array_equal(*images)
