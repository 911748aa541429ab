"""Images of every world in every weather against stored ones; `studio.py` makes them."""

import itertools

import numpy as np
import pytest
from studio import VIEWS, WEATHERS, Studio, stored


@pytest.fixture(scope="module", params=VIEWS)
def studio(request):
    made = Studio(request.param)
    made.view = request.param
    yield made
    made.close()


@pytest.mark.parametrize("weather", WEATHERS)
def test_an_image_is_the_stored_one(studio, weather):
    """But for edges of leaves, which another machine's last bits may move."""
    colour = studio.shoot(weather).colour[0].astype(int)
    off = np.abs(colour - stored(studio.view, weather))
    assert off.mean() < 0.5
    assert (off.max(axis=-1) > 12).mean() < 0.01


@pytest.mark.parametrize("view", VIEWS)
def test_every_weather_looks_different(view):
    for one, other in itertools.combinations(WEATHERS, 2):
        apart = np.abs(stored(view, one).astype(int) - stored(view, other)).mean()
        assert apart > 5.0, (one, other)


def test_fog_hides_what_is_beyond_its_visibility(studio):
    depth = studio.shoot("fog", parts=("depth",)).depth[0]
    fog = stored(studio.view, "fog").astype(float)
    haze = fog[np.isinf(depth)].mean(axis=0)
    contrast = np.abs(fog - haze).max(axis=-1)
    far = (depth > 70.0) & np.isfinite(depth)
    near = depth < np.quantile(depth, 0.1)
    assert contrast[far].mean() < 10.0
    assert contrast[near].mean() > 3.0 * contrast[far].mean() + 20.0
