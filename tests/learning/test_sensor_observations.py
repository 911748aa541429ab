"""Observations of LIDARs and cameras, in several worlds."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from volery.autonomy.policy import sensor_terms
from volery.core.errors import ScenarioError
from volery.learning.actions import LevelVelocity
from volery.learning.task import Task
from volery.learning.tasks import load_task
from volery.learning.terms import lines, rewards, sensor_observations, terminations
from volery.learning.vector_env import TaskVectorEnv
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario

WIDTH, HEIGHT, BEAMS = 8, 6, 36
WORLDS = (3, 4)


def scenario():
    return parse_scenario(
        {
            "name": "small_stand",
            "physics": {"rate_hz": 500, "guidance_rate_hz": 100},
            "world": {
                "terrain": {"kind": "flat", "extent_m": 20.0},
                "forest": {
                    "kind": "procedural",
                    "region_m": [2.0, -8.0, 14.0, 8.0],
                    "trees": 25,
                    "minimum_spacing_m": 1.5,
                    "species": {"snag": 1.0},
                },
            },
            "types": {
                "f450": {
                    "airframe": "f450",
                    "sensors": [
                        {"kind": "lidar", "model": "planar_36", "phase_s": 0.09},
                        {"kind": "camera", "width": WIDTH, "height": HEIGHT},
                    ],
                }
            },
            "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 2.0]}],
        }
    )


def begin(flight, envs):
    flight.values[lines.LINE][envs] = [0.0, 0.0, 1.0, 0.0]
    return EnvironmentStart(flight.draws.uniform(envs, [0, -2, 2], [0, 2, 2], (1, 3)))


def look_around():
    """A task that observes everything that LIDAR and camera see."""
    return Task(
        "look_around",
        "Fly ahead",
        scenario=scenario,
        action=LevelVelocity(2.0, 1.0),
        observations=(
            sensor_observations.lidar_sectors(sectors=12),
            sensor_observations.lidar_scan(beams=BEAMS),
            sensor_observations.depth_image(width=WIDTH, height=HEIGHT),
            sensor_observations.colour_image(width=WIDTH, height=HEIGHT),
        ),
        rewards=(lines.progress(1.0), rewards.alive(0.1)),
        terminations=(terminations.crashed(),),
        begin=begin,
        decision_rate_hz=10.0,
        episode_s=1.0,
        values={lines.LINE: (1, 4)},
        worlds=WORLDS,
        unseen_worlds=(5,),
    ).made_by(look_around)


def play(task, num_envs, threads=1, seed=7, decisions=13):
    """Observations (decisions, K, D) of flights straight ahead, and the worlds of each decision."""
    envs = TaskVectorEnv(task, num_envs, threads=threads)
    seen, worlds = [envs.reset(seed=seed)[0]], [envs.episodes.envs.world]
    for _ in range(decisions):
        seen.append(envs.step(np.full((num_envs, 2), 0.5))[0])
        worlds.append(envs.episodes.envs.world)
    envs.close()
    return np.array(seen), np.array(worlds)


@pytest.fixture(scope="module")
def played():
    return play(look_around(), 3, threads=2)


def test_each_environment_equals_a_single_one(played):
    observations, worlds = played
    for env in range(3):
        alone, own = play(look_around(), 1, seed=7 + env)
        np.testing.assert_array_equal(observations[:, env], alone[:, 0])
        np.testing.assert_array_equal(worlds[:, env], own[:, 0])


def test_observations_do_not_depend_on_threads(played):
    again, worlds = play(look_around(), 3, threads=1)
    np.testing.assert_array_equal(played[0], again)
    np.testing.assert_array_equal(played[1], worlds)


def test_episodes_change_worlds_and_see_them(played):
    observations, worlds = played
    assert set(np.unique(worlds)) == {0, 1}
    assert (worlds[0] != worlds[-1]).any()
    assert (observations >= 0.0).all()
    assert (observations[2:, :, :12].max(axis=2) > 0.0).any()
    assert np.unique(observations[3, 0, -3 * WIDTH * HEIGHT :]).size > 10


def test_tasks_with_worlds_are_pickled(played):
    task = pickle.loads(pickle.dumps(look_around()))
    assert task.worlds == WORLDS
    again, _ = play(task, 3, decisions=2)
    np.testing.assert_array_equal(played[0][:3], again)
    unseen = pickle.loads(pickle.dumps(task.in_unseen_worlds()))
    assert unseen.worlds == (5,)
    assert replace(task, unseen_worlds=()).in_unseen_worlds().worlds == WORLDS


def test_samples_are_as_old_as_their_sensors_say():
    envs = TaskVectorEnv(look_around(), 1)
    envs.reset(seed=7)
    flight = envs.episodes.flight
    assert flight.sample_age_s("horizontal") == math.inf
    envs.step(np.zeros((1, 2)))
    assert flight.sample_age_s("camera") == pytest.approx(0.0)
    assert flight.sample_age_s("horizontal") == pytest.approx(0.01)
    envs.close()


def test_a_forest_has_its_own_pool_of_worlds():
    task = load_task("forest")
    assert len(task.worlds) == 256
    assert len(task.unseen_worlds) == 200
    assert not set(task.worlds) & set(task.unseen_worlds)


def test_a_part_of_another_size_is_refused():
    part = sensor_observations.lidar_scan(beams=35)
    task = replace(look_around(), observations=(part,), worlds=())
    envs = TaskVectorEnv(task, 1)
    envs.reset(seed=0)
    with pytest.raises(ScenarioError, match="'lidar_scan': sensor 'horizontal' gives 36 numbers"):
        envs.step(np.zeros((1, 2)))
    envs.close()


def test_sectors_hold_the_nearest_echo_of_their_beams():
    angles = np.radians([-85.0, -40.0, -5.0, 5.0, 40.0, 85.0])
    ranges = np.array([[4.0, np.inf, 2.0, -np.inf, np.nan, 20.0]])
    near = sensor_terms.lidar_sectors(
        ranges,
        angles,
        sectors=3,
        angle_min_rad=-0.5 * math.pi,
        angle_max_rad=0.5 * math.pi,
        max_range_m=10.0,
    )
    np.testing.assert_allclose(near, [[0.6, 1.0, 0.0]])
    ahead = sensor_terms.lidar_sectors(
        ranges, angles, sectors=2, angle_min_rad=-0.2, angle_max_rad=0.2, max_range_m=4.0
    )
    np.testing.assert_allclose(ahead, [[0.5, 1.0]])


def test_more_sectors_than_beams_are_refused():
    with pytest.raises(ScenarioError, match="no beam in some of the 36 sectors"):
        sensor_terms.lidar_sectors(
            np.ones(8), np.linspace(-1, 1, 8), sectors=36,
            angle_min_rad=-1.0, angle_max_rad=1.0, max_range_m=5.0,
        )  # fmt: skip


def test_a_colour_image_is_channel_by_channel():
    image = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    found = sensor_terms.colour_image(image).reshape(3, 2, 3)
    np.testing.assert_allclose(found[1] * 255.0, image[..., 1])
