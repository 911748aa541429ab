"""Tests of training run where stable-baselines3 is installed."""

import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

from volery.learning.training.configuration import TrainingConfiguration

TINY = {
    "num_envs": 4,
    "hidden": (8,),
    "threads": 1,
    "evaluation_episodes": 4,
    "evaluation_period": 64,
    "target_success": 2.0,
    "ppo": {"rollout_steps": 8, "minibatch": 16, "epochs": 2},
    "dqn": {"batch": 16, "buffer_size": 400, "learning_starts": 16, "target_period": 32},
    "sac": {"batch": 16, "buffer_size": 400, "learning_starts": 16, "gradient_steps": 1},
}


@pytest.fixture
def tiny():
    """Return a configuration of seconds, with some options changed."""

    def make(**options):
        return TrainingConfiguration().changed(**{**TINY, **options})

    return make
