"""A task as data: observations, actions, rewards, and how episodes begin and end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.actions import Action
from volery.learning.flight import Flight
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.schema import Scenario


@dataclass(frozen=True)
class Observation:
    """A part of the observation."""

    name: str
    function: Callable[[Flight], Array]
    """Returns (K, n, size) numbers in `unit`."""
    size: int
    unit: str
    scale: float = 1.0
    """Divides the numbers, so that most lie between -1 and 1."""
    limit: float = 10.0
    """Largest absolute value after the scale; numbers beyond are clipped."""
    noise: float = 0.0
    """Standard deviation of white noise, in `unit`."""


@dataclass(frozen=True)
class Reward:
    """A part of the reward, which is logged by its name."""

    name: str
    function: Callable[[Flight], Array]
    """Returns (K, n) numbers."""
    weight: float


@dataclass(frozen=True)
class Termination:
    """A condition that ends an episode."""

    name: str
    function: Callable[[Flight], NDArray[np.bool_]]
    """Returns (K,) whether the episode ends."""
    is_success: bool = False
    reward: float = 0.0
    """Added once to the reward of each UAV."""


Begin = Callable[[Flight, NDArray[np.int64]], EnvironmentStart | None]
"""Begins episodes in the environments (R,): sets their `values`, and returns the motion of their
UAVs, drawn from `flight.draws`; None for the scenario's own start."""


@dataclass(frozen=True)
class Task:
    """All that defines an environment for learning."""

    name: str
    description: str
    scenario: Callable[[], Scenario]
    action: Action
    observations: tuple[Observation, ...]
    rewards: tuple[Reward, ...]
    terminations: tuple[Termination, ...]
    begin: Begin
    decision_rate_hz: float
    episode_s: float
    success: Callable[[Flight], NDArray[np.bool_]] | None = None
    """For tasks without a termination that is a success: (K,) whether an episode that reaches its
    time limit succeeds."""
    action_delay: int = 0
    """Decisions by which actions are delayed."""
    values: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Shapes of the task's `values` of one environment, by name; zeros before the first episode."""

    @property
    def observation_size(self) -> int:
        """Numbers in the observation of one UAV."""
        return sum(part.size for part in self.observations)

    @property
    def episode_decisions(self) -> int:
        """Decisions after which an episode is truncated."""
        return round(self.episode_s * self.decision_rate_hz)
