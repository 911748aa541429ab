"""Curricula: parameters of a task become harder as an environment succeeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import ScenarioError


@dataclass(frozen=True)
class Curriculum:
    """Levels of a task, from the easiest to the last.

    Each environment has a level of its own, so that it equals a single one. It rises by one when
    at least the fraction `threshold` of its last `episodes` episodes at that level succeeded.
    """

    levels: tuple[Mapping[str, float], ...]
    """Parameters of each level; those that it does not name have the task's own values."""
    threshold: float = 0.8
    episodes: int = 5

    def __post_init__(self) -> None:
        """Raises `ScenarioError` for numbers that make no sense."""
        if not self.levels:
            raise ScenarioError("a curriculum needs at least one level")
        if not 0.0 < self.threshold <= 1.0:
            raise ScenarioError(f"curriculum: threshold = {self.threshold}: above 0, at most 1")
        if self.episodes < 1:
            raise ScenarioError(f"curriculum: episodes = {self.episodes}: at least 1 is needed")


class Levels:
    """The levels of K environments.

    parameters: values of the task, by name, which the levels of `curriculum` replace. Raises
    `ScenarioError` for a level with a parameter that the task does not have.
    """

    def __init__(
        self, curriculum: Curriculum | None, parameters: Mapping[str, float], num_envs: int
    ) -> None:
        self._curriculum = curriculum
        steps = curriculum.levels if curriculum is not None else ({},)
        for step in steps:
            unknown = ", ".join(set(step) - set(parameters))
            if unknown:
                known = ", ".join(parameters) or "none"
                raise ScenarioError(
                    f"curriculum: the task has no parameter '{unknown}'; known: {known}"
                )
        self._table = {
            name: np.array([step.get(name, value) for step in steps], np.float64)
            for name, value in parameters.items()
        }
        self.level: NDArray[np.int64] = np.zeros(num_envs, np.int64)
        """(K,) level of each environment, from 0."""
        self.values = {name: table[self.level] for name, table in self._table.items()}
        """(K,) parameters of the present episodes, by name."""
        window = curriculum.episodes if curriculum is not None else 0
        self._results = np.zeros((num_envs, window), np.bool_)
        self._counts = np.zeros(num_envs, np.int64)

    def record(self, envs: NDArray[np.int64], success: NDArray[np.bool_]) -> None:
        """Records the results (R,) of episodes that ended in `envs` (R,), and raises levels."""
        curriculum = self._curriculum
        if curriculum is None:
            return
        self._results[envs, self._counts[envs] % curriculum.episodes] = success
        self._counts[envs] += 1
        full = self._counts[envs] >= curriculum.episodes
        good = self._results[envs].mean(axis=1) >= curriculum.threshold - 1e-9
        rises = envs[full & good & (self.level[envs] < len(curriculum.levels) - 1)]
        self.level[rises] += 1
        self._counts[rises] = 0
        self._results[rises] = False

    def begin(self, envs: NDArray[np.int64]) -> None:
        """Sets the parameters of the episodes that begin in `envs` (R,)."""
        if self._curriculum is not None:
            for name, table in self._table.items():
                self.values[name][envs] = table[self.level[envs]]

    def get_state(self) -> dict[str, Any]:
        """Returns copies of levels, parameters and results, a row per environment each."""
        return {
            "level": self.level.copy(),
            "values": {name: value.copy() for name, value in self.values.items()},
            "results": self._results.copy(),
            "counts": self._counts.copy(),
        }

    def set_state(
        self, state: dict[str, Any], envs: NDArray[np.int64] | slice = slice(None)
    ) -> None:
        """Restores a state of `get_state`, of the environments `envs` alone."""
        self.level[envs] = state["level"][envs]
        for name, value in state["values"].items():
            self.values[name][envs] = value[envs]
        self._results[envs] = state["results"][envs]
        self._counts[envs] = state["counts"][envs]
