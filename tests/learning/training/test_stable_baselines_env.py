"""The adapter gives stable-baselines3 what the vector environment gives."""

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from volery.core.errors import CommandError, ScenarioError
from volery.learning.adapters.stable_baselines import StableBaselinesEnv
from volery.learning.registration import register_tasks
from volery.learning.tasks import load_task
from volery.learning.vector_env import TaskVectorEnv


@pytest.fixture(scope="module")
def pair():
    """Return the adapter of an environment, and an equal environment without one."""
    task = load_task("homing")
    adapted = StableBaselinesEnv(TaskVectorEnv(task, 3, threads=1), reward_scale=0.5)
    plain = TaskVectorEnv(task, 3, threads=1)
    yield adapted, plain
    adapted.close()
    plain.close()


@pytest.fixture(scope="module")
def played(pair):
    """Return what both bring until some episodes end at the time limit."""
    adapted, plain = pair
    adapted.seed(3)
    steps = [(adapted.reset(), plain.reset(seed=3)[0])]
    for _ in range(80):
        actions = np.zeros(3, np.int64)
        steps.append((adapted.step(actions), plain.step(actions)))
    return steps


def test_observations_rewards_and_ends_are_those_of_the_environment(played):
    np.testing.assert_array_equal(*played[0])
    for (seen, reward, done, _), (own, own_reward, terminated, truncated, _) in played[1:]:
        np.testing.assert_array_equal(seen, own)
        np.testing.assert_array_equal(reward, (0.5 * own_reward).astype(np.float32))
        np.testing.assert_array_equal(done, terminated | truncated)


def test_only_ends_have_infos_of_their_own(played):
    ended = 0
    for (_, _, done, infos), (_, _, _, truncated, info) in played[1:]:
        running = [infos[k] for k in np.flatnonzero(~done)]
        assert all(each is running[0] and each == {} for each in running)
        for k in np.flatnonzero(done):
            ended += 1
            own = infos[k]
            np.testing.assert_array_equal(own["terminal_observation"], info["final_obs"][k])
            assert own["TimeLimit.truncated"] == truncated[k]
            assert own["episode"] == {
                "r": info["episode_return"][k],
                "l": info["episode_length"][k],
            }
            assert own["is_success"] == info["success"][k]
            assert sum(own["reward_terms"].values()) == pytest.approx(own["episode"]["r"])
    assert ended >= 3


def test_arrays_are_not_changed_by_later_steps(pair):
    adapted, _ = pair
    first = adapted.reset()
    kept = first.copy()
    second = adapted.step(np.ones(3, np.int64))[0]
    np.testing.assert_array_equal(first, kept)
    assert not np.shares_memory(first, second)


def test_time_limits_are_unmarked_on_demand():
    env = StableBaselinesEnv(TaskVectorEnv(load_task("homing"), 1, threads=1), marks_timeouts=False)
    env.reset()
    for _ in range(75):
        _, _, done, infos = env.step(np.zeros(1, np.int64))
    assert done[0]
    assert "TimeLimit.truncated" not in infos[0]
    env.close()


def test_another_automatic_reset_is_refused():
    plain = TaskVectorEnv(load_task("homing"), 1, autoreset_mode="NextStep", threads=1)
    with pytest.raises(ScenarioError, match='autoreset_mode="SameStep"'):
        StableBaselinesEnv(plain)
    plain.close()


def test_there_are_no_single_environments(pair):
    adapted, _ = pair
    assert adapted.get_attr("task")[0].name == "homing"
    assert adapted.env_is_wrapped(object, [0, 2]) == [False, False]
    with pytest.raises(CommandError, match="rows of one simulation"):
        adapted.env_method("reset")
    with pytest.raises(CommandError, match="rows of one simulation"):
        adapted.set_attr("task", None)


@pytest.mark.parametrize("name", ["volery/Hover-v0", "volery/Homing-v0"])
def test_environments_are_made_by_name(name):
    """The library asks for a render mode, and makes them without one where that is a TypeError."""
    register_tasks()
    envs = make_vec_env(name, 2, seed=1)
    model = PPO("MlpPolicy", name, n_steps=8, batch_size=8)
    try:
        assert envs.reset().shape == (2, *envs.observation_space.shape)
        model.learn(8)
    finally:
        envs.close()
        model.get_env().close()
