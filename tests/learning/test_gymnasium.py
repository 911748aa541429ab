"""The environments as Gymnasium makes, wraps and describes them."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import vector as wrappers

from volery.core.errors import CommandError, ScenarioError
from volery.learning.registration import register_tasks


@pytest.fixture(scope="module", autouse=True)
def registered():
    register_tasks()


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_statistics_of_episodes_are_recorded(mode):
    envs = gymnasium.make_vec(
        "volery/Homing-v0", num_envs=3, max_episode_steps=4, autoreset_mode=mode
    )
    recorded = wrappers.RecordEpisodeStatistics(envs)
    try:
        recorded.reset(seed=0)
        seen = []
        while len(recorded.return_queue) < 6:
            *_, info = recorded.step(recorded.action_space.sample())
            if "episode" in info:
                over = info["_episode"]
                np.testing.assert_array_equal(over, info["_end"])
                np.testing.assert_allclose(info["episode"]["r"], info["episode_return"])
                np.testing.assert_array_equal(info["episode"]["l"], info["episode_length"])
                seen += info["episode"]["r"][over].tolist()
        assert list(recorded.return_queue) == pytest.approx(seen)
        assert max(recorded.length_queue) <= 4
    finally:
        recorded.close()


@pytest.mark.parametrize(
    "wrapper",
    [
        wrappers.NormalizeObservation,
        wrappers.NormalizeReward,
        wrappers.DictInfoToList,
        lambda envs: wrappers.ClipReward(envs, -1.0, 1.0),
        lambda envs: wrappers.DtypeObservation(envs, np.float64),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow encountered in cast")  # of Box with a larger dtype
def test_wrappers_for_vectors_step_over_ends_of_episodes(wrapper):
    options = {"max_episode_steps": 3, "autoreset_mode": "NextStep"}
    envs = wrapper(gymnasium.make_vec("volery/Homing-v0", num_envs=2, **options))
    try:
        envs.reset(seed=0)
        for _ in range(7):
            envs.step(envs.action_space.sample())
    finally:
        envs.close()


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_rendering_is_refused_and_none_is_accepted(make):
    make("volery/Hover-v0", render_mode=None).close()
    for mode in ("rgb_array", "human"):
        with pytest.raises(ScenarioError, match=f"'{mode}'.*do not render, only None"):
            make("volery/Hover-v0", render_mode=mode)


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_render_warns_and_returns_none(make):
    env = make("volery/Hover-v0")
    try:
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="do not render; .*film_episode"):
            assert env.render() is None
    finally:
        env.close()


def test_actions_of_a_single_environment_are_described_as_its_own():
    env = gymnasium.make("volery/Hover-v0", disable_env_checker=True)
    try:
        assert repr(env.unwrapped) == "<TaskEnv 'hover'>"
        env.reset(seed=0)
        for wrong, shape in (
            (np.zeros(3), r"\(3,\)"),
            (0.5, r"\(\)"),
            (np.zeros((1, 4)), r"\(1, 4\)"),
        ):
            with pytest.raises(CommandError, match=rf"an action has shape \(4,\), not {shape}"):
                env.step(wrong)
    finally:
        env.close()


@pytest.mark.parametrize("seed", [2**70, 1.5, "a", [2**70, 0]])
def test_seeds_that_are_none_are_refused(seed):
    envs = gymnasium.make_vec("volery/Hover-v0", num_envs=2)
    try:
        with pytest.raises(CommandError, match="a whole number from 0 on, up to 2"):
            envs.reset(seed=seed)
        assert envs.reset(seed=[2**62, None])[0].shape == (2, 22)
    finally:
        envs.close()


@pytest.mark.parametrize("num_envs", [0, -1])
def test_environments_are_at_least_one(num_envs):
    with pytest.raises(ScenarioError, match=f"num_envs = {num_envs}: at least 1 is needed"):
        gymnasium.make_vec("volery/Hover-v0", num_envs=num_envs)


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_episodes_can_be_shortened(make):
    env = make("volery/Homing-v0", max_episode_steps=2)
    try:
        env.reset(seed=0)
        env.step(env.action_space.sample())
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert np.all(truncated)
        assert not np.any(terminated)
    finally:
        env.close()


def test_less_than_one_step_is_refused():
    with pytest.raises(ScenarioError, match="at least 1"):
        gymnasium.make_vec("volery/Homing-v0", max_episode_steps=0)


def test_a_spec_is_json_from_which_the_same_environment_is_made():
    text = gymnasium.spec("volery/Homing-v0").to_json()
    env, twin = gymnasium.make("volery/Homing-v0"), gymnasium.make(EnvSpec.from_json(text))
    try:
        np.testing.assert_array_equal(env.reset(seed=3)[0], twin.reset(seed=3)[0])
        assert twin.unwrapped.task.name == "homing"
        assert "homing" in env.spec.to_json()
    finally:
        env.close()
        twin.close()
