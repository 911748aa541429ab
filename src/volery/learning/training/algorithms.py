"""Makes the algorithms of stable-baselines3 from a configuration."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from volery.core.errors import VoleryError
from volery.learning.adapters.stable_baselines import StableBaselinesEnv
from volery.learning.training.configuration import TrainingConfiguration

_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}


class BatchDqn(DQN):
    """Deep Q-learning whose random actions are drawn for each environment, not for all at once."""

    def predict(
        self,
        observation: NDArray[np.float32] | dict[str, NDArray[np.float32]],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...] | None]:
        """Returns actions (K,), some of which are random unless `deterministic`."""
        action, state = self.policy.predict(observation, state, episode_start, deterministic)
        if not deterministic:
            random = self.action_space.np_random
            is_random = random.random(len(action)) < self.exploration_rate
            action = np.where(is_random, random.integers(self._choices, size=len(action)), action)
        return action, state

    @property
    def _choices(self) -> int:
        assert isinstance(self.action_space, Discrete)
        return int(self.action_space.n)


def make_algorithm(configuration: TrainingConfiguration, env: StableBaselinesEnv) -> BaseAlgorithm:
    """Returns the algorithm of a configuration; its random numbers start from the seed.

    Raises `VoleryError` if the algorithm does not fit the actions of the task.
    """
    name = configuration.algorithm
    is_discrete = isinstance(env.action_space, Discrete)
    if name == "dqn" and not is_discrete:
        raise VoleryError("dqn needs discrete actions; this task has continuous ones: use ppo, sac")
    if name == "sac" and not isinstance(env.action_space, Box):
        raise VoleryError("sac needs continuous actions; this task has discrete ones: use dqn, ppo")
    common: dict[str, Any] = {
        "policy": "MlpPolicy",
        "env": env,
        "learning_rate": _schedule(configuration),
        "gamma": configuration.gamma,
        "seed": configuration.seed,
        "device": "cpu",
        "policy_kwargs": _network(configuration),
    }
    make = {"ppo": _ppo, "dqn": _dqn, "sac": _sac}[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # advice on batch sizes
        return make(configuration, env, common)


def _ppo(
    configuration: TrainingConfiguration, env: StableBaselinesEnv, common: dict[str, Any]
) -> BaseAlgorithm:
    options = configuration.ppo
    if isinstance(env.action_space, Box):
        common["policy_kwargs"]["log_std_init"] = options.initial_log_std
    return PPO(
        **common,
        n_steps=options.rollout_steps,
        batch_size=min(options.minibatch, options.rollout_steps * env.num_envs),
        n_epochs=options.epochs,
        gae_lambda=options.gae_lambda,
        clip_range=options.clip_range,
        ent_coef=options.entropy_weight,
        vf_coef=options.value_weight,
        max_grad_norm=options.max_gradient,
    )


def _dqn(
    configuration: TrainingConfiguration, env: StableBaselinesEnv, common: dict[str, Any]
) -> BaseAlgorithm:
    options = configuration.dqn
    return BatchDqn(
        **common,
        buffer_size=max(options.buffer_size, env.num_envs),
        batch_size=options.batch,
        train_freq=options.rollout_steps,
        gradient_steps=options.gradient_steps,
        learning_starts=options.learning_starts,
        target_update_interval=options.target_period,
        tau=options.tau,
        exploration_fraction=options.exploration_fraction,
        exploration_final_eps=options.final_exploration,
        max_grad_norm=options.max_gradient,
    )


def _sac(
    configuration: TrainingConfiguration, env: StableBaselinesEnv, common: dict[str, Any]
) -> BaseAlgorithm:
    options = configuration.sac
    return SAC(
        **common,
        buffer_size=max(options.buffer_size, env.num_envs),
        batch_size=options.batch,
        train_freq=options.rollout_steps,
        gradient_steps=options.gradient_steps,
        learning_starts=options.learning_starts,
        tau=options.tau,
    )


def _network(configuration: TrainingConfiguration) -> dict[str, Any]:
    hidden = list(configuration.hidden)
    shape: Any = {
        "ppo": {"pi": hidden, "vf": hidden},
        "dqn": hidden,
        "sac": {"pi": hidden, "qf": hidden},
    }[configuration.algorithm]
    return {"net_arch": shape, "activation_fn": _ACTIVATIONS[configuration.activation]}


def _schedule(configuration: TrainingConfiguration) -> float | Callable[[float], float]:
    """Returns the learning rate, as a function of the remaining fraction if it changes."""
    first, last = configuration.learning_rate, configuration.final_learning_rate
    if last is None:
        return first
    return lambda remaining: last + (first - last) * remaining
