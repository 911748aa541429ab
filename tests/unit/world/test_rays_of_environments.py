"""Rays of many environments in one batch see what they see alone: their own bodies and actors."""

import numpy as np
import pytest

from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.world.scene import Scene


@pytest.mark.parametrize("uavs_per_env", [1, 3])
def test_a_batch_of_environments_equals_its_rays_alone(uavs_per_env):
    draw = np.random.default_rng(uavs_per_env)
    envs = 40
    count = envs * uavs_per_env
    scene = Scene(None, None)
    scene.set_bodies([body_shape(load_airframe("f450"))], [0] * count, num_envs=envs)
    position = draw.uniform([-1.5, -1.5, 1.0], [1.5, 1.5, 3.0], (count, 3))
    scene.move_bodies(position, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
    rows = np.repeat(np.arange(count), 19)
    directions = draw.normal(size=(len(rows), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = scene.cast(position[rows], directions, 20.0, exclude=rows)
    for row in range(count):
        own = rows == row
        alone = scene.cast(position[rows[own]], directions[own], 20.0, exclude=row)
        np.testing.assert_array_equal(hits.distance[own], alone.distance)
        np.testing.assert_array_equal(hits.instance[own], alone.instance)
    seen = hits.instance[hits.instance >= 0] - scene.moving_offset
    own_env = rows[hits.instance >= 0] // uavs_per_env
    np.testing.assert_array_equal(seen // uavs_per_env, own_env)
    assert (len(seen) > 0) == (uavs_per_env > 1)
    scene.close()
