"""Evaluates policies on episodes of seeds that no training uses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.task import Task
from volery.learning.vector_env import TaskVectorEnv

Act = Callable[[NDArray[np.float32]], NDArray[Any]]
"""Returns the actions (K, A), or choices (K,), for observations (K, D)."""
VALIDATION_SEEDS = 1 << 40
"""First seed of the episodes on which training chooses its best policy."""
TEST_SEEDS = 1 << 41
"""First seed of `evaluate`: no training uses it or those after it."""
TIME_LIMIT = "time_limit"
_MAX_ENVS = 256
_Z_95 = 1.959963984540054
"""Quantile of the normal distribution for a confidence of 95 %."""


@dataclass(frozen=True)
class Evaluation:
    """Result of a number of episodes."""

    task: str
    episodes: int
    success: float
    """Fraction of episodes that succeed."""
    success_low: float
    """Lower bound of its 95 % confidence interval (Wilson)."""
    success_high: float
    """Upper bound of its 95 % confidence interval (Wilson)."""
    mean_return: float
    mean_length_s: float
    """Mean duration of an episode, s of simulated time."""
    reward_terms: dict[str, float]
    """Mean sum of each weighted reward in an episode."""
    ends: dict[str, float]
    """Fraction of episodes that each termination, or the time limit, ends."""
    decisions: int
    """Decisions of all environments that the evaluation took."""

    def as_dict(self) -> dict[str, Any]:
        """Returns the result as plain data."""
        return asdict(self)


class Evaluator:
    """Runs evaluations of one task in environments that are made once."""

    def __init__(self, task: Task, episodes: int, *, seed: int, threads: int = 2) -> None:
        self.task = replace(task, curriculum=None)  # at full difficulty
        self.episodes = episodes
        self._seed = seed
        envs = min(episodes, _MAX_ENVS)
        self.envs = TaskVectorEnv(self.task, envs, threads=threads)
        quota = np.full(envs, episodes // envs) + (np.arange(envs) < episodes % envs)
        self._quota = np.repeat(quota, task.num_agents)

    def run(self, act: Act, on_decision: Callable[[int], None] | None = None) -> Evaluation:
        """Returns the result of `act`; each environment runs the same number of episodes.

        on_decision: called after each decision with the number of episodes done.
        """
        records, agents = _Records(self.task), self.task.num_agents
        left = self._quota.copy()
        observation, _ = self.envs.reset(seed=self._seed)
        decisions = 0
        while left.any():
            observation, _, terminated, truncated, info = self.envs.step(act(observation))
            decisions += len(observation)
            over = (terminated | truncated) & (left > 0)
            if over.any():
                records.add(over, info)
                left[over] -= 1
            if on_decision is not None:
                on_decision(records.count // agents)
        return records.result(self.episodes, decisions)

    def close(self) -> None:
        """Releases the environments."""
        self.envs.close()


def evaluate_actions(
    task: Task,
    act: Act,
    episodes: int = 200,
    *,
    seed: int = 0,
    threads: int = 2,
    on_decision: Callable[[int], None] | None = None,
) -> Evaluation:
    """Returns the result of `act` in `episodes` episodes of seeds that no training uses.

    A task with unseen worlds takes place in those.
    """
    evaluator = Evaluator(
        task.in_unseen_worlds(), episodes, seed=TEST_SEEDS + seed, threads=threads
    )
    try:
        return evaluator.run(act, on_decision)
    finally:
        evaluator.close()


def wilson_interval(fraction: float, count: int, z: float = _Z_95) -> tuple[float, float]:
    """Returns the Wilson confidence interval of a fraction of `count` trials.

    Wilson, "Probable inference, the law of succession, and statistical inference", 1927, eq. 3.
    """
    if count < 1:
        return 0.0, 1.0
    middle = (fraction + z * z / (2 * count)) / (1 + z * z / count)
    spread = math.sqrt(fraction * (1 - fraction) / count + z * z / (4 * count * count))
    half = z * spread / (1 + z * z / count)
    return max(0.0, min(fraction, middle - half)), min(1.0, max(fraction, middle + half))


class _Records:
    """Sums over episodes that have ended."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._returns: list[Array] = []
        self._lengths: list[NDArray[np.int64]] = []
        self._successes: list[NDArray[np.bool_]] = []
        self._ends: list[NDArray[np.int64]] = []
        self._terms: dict[str, float] = {part.name: 0.0 for part in task.rewards}

    @property
    def count(self) -> int:
        """Number of episodes."""
        return sum(len(part) for part in self._returns)

    def add(self, over: NDArray[np.bool_], info: dict[str, Any]) -> None:
        """Adds the episodes that end in the environments `over` (K,)."""
        self._returns.append(info["episode_return"][over])
        self._lengths.append(info["episode_length"][over])
        self._successes.append(info["success"][over])
        self._ends.append(info["end"][over])
        for name, sums in info["reward_terms"].items():
            self._terms[name] += float(sums[over].sum())

    def result(self, episodes: int, decisions: int) -> Evaluation:
        """Returns the means over all UAVs of the policy."""
        count = self.count
        success = float(np.concatenate(self._successes).mean())
        low, high = wilson_interval(success, episodes)
        ends = np.concatenate(self._ends)
        names = [*(part.name for part in self._task.terminations), TIME_LIMIT]
        length = float(np.concatenate(self._lengths).mean()) / self._task.decision_rate_hz
        return Evaluation(
            task=self._task.name,
            episodes=episodes,
            success=success,
            success_low=low,
            success_high=high,
            mean_return=float(np.concatenate(self._returns).mean()),
            mean_length_s=length,
            reward_terms={name: total / count for name, total in self._terms.items()},
            ends={name: float((ends == i).mean()) for i, name in enumerate(names)},
            decisions=decisions,
        )
