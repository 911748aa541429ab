"""The state of an algorithm of stable-baselines3 between two updates, for checkpoints."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from stable_baselines3 import DQN, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from volery.core.errors import VoleryError
from volery.learning.adapters.stable_baselines import StableBaselinesEnv
from volery.learning.training.checkpoint import random_states, restore_random_states

_COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
_DQN_COUNTERS = ("_n_calls", "exploration_rate")
_BUFFER_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def algorithm_state(algorithm: BaseAlgorithm, env: StableBaselinesEnv) -> dict[str, Any]:
    """Returns everything that changes: networks, optimizers, buffer, counters, environments."""
    state: dict[str, Any] = {
        "parameters": algorithm.get_parameters(),
        "counters": {name: getattr(algorithm, name) for name in _counters(algorithm)},
        "last_observation": np.array(algorithm._last_obs),
        "last_starts": np.array(algorithm._last_episode_starts),
        "action_space": algorithm.action_space.np_random.bit_generator.state,
        "random": random_states(),
        "envs": env.envs.get_state(),
    }
    if isinstance(algorithm, SAC) and algorithm.log_ent_coef is not None:
        state["log_entropy_weight"] = algorithm.log_ent_coef.detach().numpy().copy()
    if isinstance(algorithm, OffPolicyAlgorithm):
        buffer = _buffer(algorithm)
        filled = buffer.buffer_size if buffer.full else buffer.pos
        state["buffer"] = {
            "position": (buffer.pos, buffer.full),
            **{name: getattr(buffer, name)[:filled] for name in _BUFFER_ARRAYS},
        }
    return state


def restore_algorithm_state(
    algorithm: BaseAlgorithm, env: StableBaselinesEnv, state: dict[str, Any]
) -> None:
    """Restores what `algorithm_state` returned, in an algorithm of the same configuration.

    Raises `VoleryError` if the networks or environments have other shapes.
    """
    if state["last_observation"].shape != (env.num_envs, *(env.observation_space.shape or ())):
        raise VoleryError(
            "the checkpoint is of other environments: observations "
            f"{state['last_observation'].shape}, not {(env.num_envs, *env.observation_space.shape)}"
            if env.observation_space.shape
            else "the checkpoint is of other environments"
        )
    try:
        algorithm.set_parameters(state["parameters"], exact_match=True, device="cpu")
    except (RuntimeError, ValueError) as error:
        reason = str(error).split("\n")[0]
        raise VoleryError(f"the checkpoint is of other networks: {reason}") from None
    for name, value in state["counters"].items():
        setattr(algorithm, name, value)
    algorithm._last_obs = state["last_observation"].copy()
    algorithm._last_episode_starts = state["last_starts"].copy()
    algorithm.action_space.np_random.bit_generator.state = state["action_space"]
    if isinstance(algorithm, SAC) and algorithm.log_ent_coef is not None:
        algorithm.log_ent_coef.data.numpy()[:] = state["log_entropy_weight"]
    if isinstance(algorithm, OffPolicyAlgorithm):
        buffer, kept = _buffer(algorithm), state["buffer"]
        buffer.pos, buffer.full = kept["position"]
        for name in _BUFFER_ARRAYS:
            getattr(buffer, name)[: len(kept[name])] = kept[name]
    env.envs.set_state(state["envs"])
    restore_random_states(state["random"])


def _counters(algorithm: BaseAlgorithm) -> tuple[str, ...]:
    return _COUNTERS + (_DQN_COUNTERS if isinstance(algorithm, DQN) else ())


def _buffer(algorithm: OffPolicyAlgorithm) -> ReplayBuffer:
    return cast(ReplayBuffer, algorithm.replay_buffer)
