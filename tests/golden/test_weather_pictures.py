"""Pictures in every weather against those that are stored; `weather_pictures.py` makes them."""

import itertools

import numpy as np
import pytest
from weather_pictures import WEATHERS, Studio, stored


@pytest.fixture(scope="module")
def studio():
    made = Studio()
    yield made
    made.close()


@pytest.mark.parametrize("weather", WEATHERS)
def test_a_picture_is_the_stored_one(studio, weather):
    """But for edges of leaves, which another machine's last bits may move."""
    colour = studio.shoot(weather).colour[0].astype(int)
    off = np.abs(colour - stored(weather))
    assert off.mean() < 0.5
    assert (off.max(axis=-1) > 12).mean() < 0.01


def test_every_weather_looks_different():
    for one, other in itertools.combinations(WEATHERS, 2):
        apart = np.abs(stored(one).astype(int) - stored(other)).mean()
        assert apart > 8.0, (one, other)


def test_fog_hides_what_is_beyond_its_visibility(studio):
    fog, depth = stored("fog").astype(float), studio.shoot("fog", parts=("depth",)).depth[0]
    haze = fog[np.isinf(depth)].mean(axis=0)
    contrast = np.abs(fog - haze).max(axis=-1)
    assert contrast[(depth > 70.0) & np.isfinite(depth)].mean() < 10.0
    assert contrast[depth < 6.0].mean() > 60.0
