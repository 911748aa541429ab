"""Training libraries take the environments: natively, or through the adapters."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError
from volery.learning.registration import register_tasks
from volery.learning.single_env import TaskEnv
from volery.learning.tasks import load_task
from volery.learning.vector_env import TaskVectorEnv


@pytest.fixture
def make():
    made = []

    def build(name="hover", count=3, episode_s=None, **options):
        task = load_task(name)
        task = task if episode_s is None else replace(task, episode_s=episode_s)
        made.append(TaskVectorEnv(task, count, **options))
        return made[-1]

    yield build
    for env in made:
        env.close()


def test_gymnasium_steps_single_environments_in_processes():
    register_tasks()
    env = gymnasium.make_vec("volery/Homing-v0", num_envs=2, vectorization_mode="async")
    single = TaskEnv(load_task("homing"))
    try:
        observation, _ = env.reset(seed=[4, 5])
        np.testing.assert_array_equal(observation[0], single.reset(seed=4)[0])
        for action in (1, 3, 5):
            stepped = env.step(np.array([action, 0]))
            alone = single.step(action)
            np.testing.assert_array_equal(stepped[0][0], alone[0])
            assert stepped[1][0] == alone[1]
    finally:
        env.close()
        single.close()


@pytest.mark.slow
def test_stable_baselines_checks_a_single_environment():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    for name in ("hover", "homing"):
        env = TaskEnv(load_task(name))
        checker.check_env(env)
        env.close()


@pytest.mark.slow
def test_skrl_takes_the_native_environment(make):
    wrappers = pytest.importorskip("skrl.envs.wrappers.torch")
    torch = pytest.importorskip("torch")
    env = wrappers.wrap_env(make(), verbose=False)
    observation, _ = env.reset()
    assert tuple(observation.shape) == (3, env.observation_space.shape[0])
    for _ in range(3):
        observation, reward, terminated, truncated, _ = env.step(torch.zeros(3, 4))
    assert tuple(reward.shape) == tuple(terminated.shape) == tuple(truncated.shape) == (3, 1)
    assert torch.isfinite(observation).all()


@pytest.mark.slow
def test_torchrl_takes_the_native_environment(make):
    envs = pytest.importorskip("torchrl.envs")
    env = envs.GymWrapper(make("hover", 3, autoreset_mode="SameStep"))
    rollout = env.rollout(4, break_when_any_done=False)
    assert tuple(rollout["action"].shape) == (3, 4, 4)
    assert tuple(rollout["next", "reward"].shape) == (3, 4, 1)


@pytest.fixture
def adapter():
    pytest.importorskip("torch")
    pytest.importorskip("tensordict")
    from volery.learning.adapters.rsl_rl import RslRlEnv

    return RslRlEnv


@pytest.mark.slow
def test_the_adapter_of_rsl_rl_passes_everything_on(make, adapter):
    import torch

    many, twin = make("hover", 4, 0.1), make("hover", 4, 0.1)
    env = adapter(many)
    observation, _ = twin.reset(seed=3)
    np.testing.assert_array_equal(env.reset(seed=3)["policy"].numpy(), observation)
    time_outs = logged = 0
    for _ in range(25):
        action = torch.full((4, 4), -0.2)
        groups, reward, done, extras = env.step(action)
        expected = twin.step(action.numpy())
        np.testing.assert_array_equal(groups["policy"].numpy(), expected[0])
        np.testing.assert_allclose(reward.numpy(), expected[1], rtol=1e-6)
        np.testing.assert_array_equal(done.numpy(), expected[2] | expected[3])
        time_outs += int(extras["time_outs"].sum())
        logged += "log" in extras
        np.testing.assert_array_equal(
            env.episode_length_buf.numpy(), twin.episodes.flight.decisions
        )
    assert (logged, time_outs) == (2, 8)
    with pytest.raises(CommandError, match="init_at_random_ep_len=False"):
        env.episode_length_buf = torch.zeros(4)
    with pytest.raises(ScenarioError, match="discrete actions"):
        adapter(make("homing"))
    with pytest.raises(ScenarioError, match="SameStep"):
        adapter(make(autoreset_mode="Disabled"))


@pytest.mark.slow
def test_the_ppo_of_rsl_rl_learns_a_rollout(make, adapter, tmp_path, capsys):
    runners = pytest.importorskip("rsl_rl.runners")
    network = {"class_name": "MLPModel", "hidden_dims": [16], "activation": "tanh"}
    configuration = {
        "num_steps_per_env": 8,
        "save_interval": 10,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {
            **network,
            "distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.5},
        },
        "critic": network,
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": 1,
            "num_mini_batches": 1,
        },
    }
    runner = runners.OnPolicyRunner(adapter(make("hover", 8)), configuration, None, "cpu")
    runner.learn(2)
    assert runner.current_learning_iteration == 1
    capsys.readouterr()
