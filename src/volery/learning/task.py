"""A task as data: observations, actions, rewards, and how episodes begin and end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pickle import PicklingError
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.actions import Action
from volery.learning.curriculum import Curriculum
from volery.learning.flight import Flight
from volery.learning.randomization import Variation
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.schema import Scenario

Range: TypeAlias = float | tuple[float, float]
"""A number, or two bounds between which each episode of an environment draws one."""


@dataclass(frozen=True)
class Observation:
    """A part of the observation."""

    name: str
    function: Callable[[Flight], Array]
    """Returns (K, n, size) numbers in `unit`."""
    size: int
    """Numbers at one decision."""
    unit: str
    scale: float = 1.0
    """Divides the numbers, so that most lie between -1 and 1."""
    limit: float = 10.0
    """Largest absolute value after the scale; numbers beyond are clipped."""
    noise: Range = 0.0
    """Standard deviation of white noise, in `unit`."""
    bias: Range = 0.0
    """Standard deviation of an error that stays the same during an episode, in `unit`."""
    latency_s: Range = 0.0
    """Age of the numbers at the decision, rounded to physics steps."""
    history: int = 1
    """Numbers of the last `history` decisions are stacked, the oldest first."""
    source: Literal["truth", "estimate"] = "truth"
    """`flight.state` of the function: ground truth, or the estimate of the sensor `odom`."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """What the function uses beside the flight, as JSON values: the node `policy` finds its
    counterpart by `name` and calls it with them."""
    image: tuple[str, str] | None = None
    """Camera, and part of its images ("colour", "depth"), that the function uses; cameras render
    no other parts."""

    @property
    def numbers(self) -> int:
        """Numbers of this part in the observation, its history included."""
        return self.size * self.history


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
    """Returns (K,) whether the episode ends, or (K, n) which UAVs end it, for all of them.

    Those UAVs are terminated, their teammates truncated: what they could still gain is no loss.
    """
    is_success: bool = False
    reward: float = 0.0
    """Added once to the reward of each UAV, or of those that end the episode."""


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
    action_latency_s: Range = 0.0
    """Time after which an action takes effect, rounded to physics steps; zeros act before."""
    action_noise: Range = 0.0
    """Standard deviation of white noise of continuous actions, which are from -1 to 1."""
    action_bias: Range = 0.0
    """Standard deviation of an error of actions that stays the same during an episode."""
    randomization: tuple[Variation, ...] = ()
    """What each episode draws anew: wind, masses, ..."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Numbers that functions read as `flight.parameters[name]` (K,): the full difficulty."""
    curriculum: Curriculum | None = None
    """Levels of easier `parameters`."""
    values: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Shapes of the task's `values` of one environment, by name; zeros before the first episode."""
    advance: Callable[[Flight], None] | None = None
    """Changes `values` once after each decision, before rewards and terminations: moving goals."""
    worlds: tuple[int, ...] = ()
    """Seeds of the worlds in which episodes take place: each begins in one of them, drawn from the
    environment's stream. Empty: that of the scenario."""
    unseen_worlds: tuple[int, ...] = ()
    """Seeds of other worlds, for tests of policies; see `in_unseen_worlds`."""
    num_agents: int = 1
    """UAVs that the policy flies, m: the first of the scenario's n."""
    script: Callable[[Flight], Array] | None = None
    """Returns the actions (K, n - m, A) of the other UAVs."""

    def in_unseen_worlds(self) -> Task:
        """Returns the task in its `unseen_worlds`; itself if it has none."""
        if not self.unseen_worlds:
            return self
        task = replace(self, worlds=self.unseen_worlds)
        return task.made_by(_unseen, *self._call) if self.is_picklable else task  # type: ignore[attr-defined]

    @property
    def observation_size(self) -> int:
        """Numbers in the observation of one UAV."""
        return sum(part.numbers for part in self.observations)

    @property
    def episode_decisions(self) -> int:
        """Decisions after which an episode is truncated."""
        return round(self.episode_s * self.decision_rate_hz)

    def made_by(self, function: Callable[..., Task], *arguments: object) -> Task:
        """Returns the task; `pickle` stores it as this call, because it holds functions.

        Tasks that `dataclasses.replace` makes of it do not know the call.
        """
        object.__setattr__(self, "_call", (function, arguments))
        return self

    @property
    def is_picklable(self) -> bool:
        """Whether the task knows the call that makes it; see `made_by`."""
        return hasattr(self, "_call")

    def __reduce__(self) -> tuple[Callable[..., Task], tuple[object, ...]]:
        """Returns the call that makes the task, for `pickle`."""
        if not self.is_picklable:
            raise PicklingError(
                f"task '{self.name}' holds functions; let a function of a module make it, and call "
                "task.made_by(function) to pickle it"
            )
        function, arguments = self._call  # type: ignore[attr-defined]
        return _remade, (function, arguments)


def _unseen(function: Callable[..., Task], arguments: tuple[object, ...]) -> Task:
    return function(*arguments).in_unseen_worlds()


def _remade(function: Callable[..., Task], arguments: tuple[object, ...]) -> Task:
    return function(*arguments).made_by(function, *arguments)
