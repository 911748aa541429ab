"""Turns the networks of stable-baselines3 into policy files."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from volery.autonomy.policy.description import NetworkDescription, TrainingRecord
from volery.autonomy.policy.policy_file import Policy, make_policy
from volery.learning.policy_description import describe
from volery.learning.task import Task
from volery.learning.training.configuration import TrainingConfiguration

Arrays = dict[str, NDArray[np.float32]]


def network_arrays(algorithm: BaseAlgorithm) -> Arrays:
    """Returns the weights by the names of policy files (see `autonomy.policy.network`).

    Of deep Q-learning, those of the target network: means over updates, which fluctuate less.
    """
    if isinstance(algorithm, PPO):
        net = algorithm.policy
        policy = [net.mlp_extractor.policy_net, net.action_net]
        value = [net.mlp_extractor.value_net, net.value_net]
        return {**_layers("policy", policy), **_layers("value", value)}
    if isinstance(algorithm, SAC):
        return _layers("policy", [algorithm.actor.latent_pi, algorithm.actor.mu])
    assert isinstance(algorithm, DQN)
    return _layers("policy", [algorithm.q_net_target.q_net])


def greedy_actions(algorithm: BaseAlgorithm, observation: NDArray[np.float32]) -> NDArray[Any]:
    """Returns the actions (K, A), or choices (K,), of the networks of `network_arrays`."""
    if isinstance(algorithm, DQN):
        with torch.no_grad():
            values = algorithm.q_net_target(torch.from_numpy(observation))
        return np.asarray(values.argmax(dim=1).numpy())
    return np.asarray(algorithm.policy.predict(observation, deterministic=True)[0])


def policy_of(
    task: Task, configuration: TrainingConfiguration, arrays: Arrays, record: TrainingRecord
) -> Policy:
    """Returns the policy of a network for a task."""
    is_discrete = task.action.choices is not None
    network = NetworkDescription(
        activation=configuration.activation,
        output="argmax" if is_discrete else "tanh" if configuration.algorithm == "sac" else "clip",
    )
    return make_policy(describe(task, network, record), dict(arrays))


def _layers(name: str, modules: list[torch.nn.Module]) -> Arrays:
    arrays: Arrays = {}
    linear = [
        layer
        for module in modules
        for layer in module.modules()
        if isinstance(layer, torch.nn.Linear)
    ]
    for k, layer in enumerate(linear):
        arrays[f"{name}.{k}.weight"] = layer.weight.detach().numpy().copy()
        arrays[f"{name}.{k}.bias"] = layer.bias.detach().numpy().copy()
    return arrays
