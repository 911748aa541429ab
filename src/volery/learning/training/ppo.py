"""Proximal policy optimization over a vector environment (Schulman et al., arXiv 1707.06347).

With generalized advantage estimation (arXiv 1506.02438). The value of a truncated episode's last
observation is added to its last reward, as its task goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from torch import Tensor

from volery.core.errors import ScenarioError
from volery.learning.training.networks import ActorCritic
from volery.learning.vector_env import TaskVectorEnv


@dataclass(frozen=True)
class PpoSettings:
    """Settings of the algorithm."""

    decisions: int = 32
    """Decisions of each environment between two updates."""
    epochs: int = 4
    batch: int = 8192
    """Decisions of one gradient step."""
    learning_rate: float = 1e-3
    discount: float = 0.98
    gae_lambda: float = 0.95
    clip: float = 0.2
    value_weight: float = 0.5
    entropy_weight: float = 0.0
    gradient_limit: float = 0.5
    target_kl: float = 0.03
    """An update ends early beyond this divergence from the policy that collected the data."""


class Finished(NamedTuple):
    """Episodes that ended while data was collected, E of them."""

    returns: list[float]
    decisions: list[int]
    successes: list[bool]


class Rollout(NamedTuple):
    """T decisions of K environments."""

    observations: Tensor
    """(T, K, D)."""
    actions: Tensor
    """(T, K, A), or (T, K) choices."""
    log_probabilities: Tensor
    """(T, K)."""
    values: Tensor
    """(T + 1, K); the last are those of the present observations."""
    rewards: Tensor
    """(T, K)."""
    ends: Tensor
    """(T, K) 1 where an episode ended with the decision."""


class Ppo:
    """Trains `network` in `env`, which must reset in the same step."""

    def __init__(
        self, env: TaskVectorEnv, network: ActorCritic, settings: PpoSettings, *, seed: int
    ) -> None:
        if env.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ScenarioError("PPO needs an environment with autoreset_mode=SameStep")
        self.env = env
        self.network = network
        self.settings = settings
        self.optimizer = torch.optim.Adam(network.parameters(), lr=settings.learning_rate, eps=1e-5)
        self.generator = torch.Generator().manual_seed(seed)
        torch.manual_seed(seed)
        self.steps = 0
        """Decisions so far, in all environments."""
        self._observation, _ = env.reset(seed=seed)

    def iterate(self) -> tuple[Finished, dict[str, float]]:
        """Collects data, improves the policy and returns ended episodes and figures."""
        finished = Finished([], [], [])
        rollout = self._collect(finished)
        self.steps += rollout.rewards.numel()
        advantages = self._advantages(rollout)
        return finished, self._update(rollout, advantages)

    @torch.no_grad()
    def _collect(self, finished: Finished) -> Rollout:
        settings, env = self.settings, self.env
        shape = (settings.decisions, env.num_envs)
        observations = torch.empty(*shape, self._observation.shape[1])
        rewards, ends, log_probabilities = (torch.empty(shape) for _ in range(3))
        values = torch.empty(settings.decisions + 1, env.num_envs)
        actions = []
        for t in range(settings.decisions):
            observation = torch.from_numpy(self._observation)
            distribution = self.network.distribution(observation)
            action = distribution.sample()
            observations[t], values[t] = observation, self.network.value(observation)
            log_probabilities[t] = distribution.log_prob(action)
            actions.append(action)
            self._observation, reward, terminated, truncated, info = env.step(action.numpy())
            rewards[t] = torch.from_numpy(reward)
            ends[t] = torch.from_numpy(terminated | truncated)
            if info:
                self._note(finished, info)
                cut = np.flatnonzero(truncated)
                last = self.network.value(torch.from_numpy(info["final_obs"][cut]))
                rewards[t, cut] += settings.discount * last
        values[-1] = self.network.value(torch.from_numpy(self._observation))
        return Rollout(observations, torch.stack(actions), log_probabilities, values, rewards, ends)

    def _note(self, finished: Finished, info: dict[str, Any]) -> None:
        over = np.flatnonzero(info["_episode"])
        finished.returns.extend(info["episode"]["r"][over].tolist())
        finished.decisions.extend(info["episode"]["l"][over].tolist())
        finished.successes.extend(info["success"][over].tolist())

    def _advantages(self, rollout: Rollout) -> Tensor:
        settings, values = self.settings, rollout.values
        advantages = torch.empty_like(rollout.rewards)
        following = torch.zeros_like(values[0])
        for t in reversed(range(settings.decisions)):
            goes_on = 1.0 - rollout.ends[t]
            error = rollout.rewards[t] + settings.discount * goes_on * values[t + 1] - values[t]
            following = error + settings.discount * settings.gae_lambda * goes_on * following
            advantages[t] = following
        return advantages

    def _update(self, rollout: Rollout, advantages: Tensor) -> dict[str, float]:
        settings = self.settings
        flat = [part.flatten(0, 1) for part in rollout[:3]]
        targets = (advantages + rollout.values[:-1]).flatten()
        flat_advantages = advantages.flatten()
        figures = {"kl": 0.0, "value_loss": 0.0, "entropy": 0.0, "gradient_steps": 0.0}
        for _ in range(settings.epochs):
            order = torch.randperm(len(targets), generator=self.generator)
            for rows in order.split(settings.batch):
                parts = [part[rows] for part in flat]
                own = self._step(*parts, flat_advantages[rows], targets[rows])
                figures["gradient_steps"] += 1
                for name, value in own.items():
                    figures[name] = value
            if figures["kl"] > settings.target_kl:
                break
        return figures

    def _step(
        self,
        observations: Tensor,
        actions: Tensor,
        old_log_probabilities: Tensor,
        advantages: Tensor,
        targets: Tensor,
    ) -> dict[str, float]:
        settings = self.settings
        distribution = self.network.distribution(observations)
        log_ratio = distribution.log_prob(actions) - old_log_probabilities
        ratio = log_ratio.exp()
        scaled = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
        policy_loss = -torch.min(ratio * scaled, clipped * scaled).mean()
        value_loss = 0.5 * (self.network.value(observations) - targets).square().mean()
        entropy = distribution.entropy().mean()
        loss = policy_loss + settings.value_weight * value_loss - settings.entropy_weight * entropy
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), settings.gradient_limit)
        self.optimizer.step()
        with torch.no_grad():
            divergence = ((ratio - 1.0) - log_ratio).mean()
        return {
            "kl": float(divergence),
            "value_loss": float(value_loss.detach()),
            "entropy": float(entropy.detach()),
        }
