"""Records of a training: means over the episodes that ended lately, and its curve."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_MIN_WINDOW = 200
"""Episodes, at least, of which the latest results are means."""


@dataclass
class Latest:
    """Results of the episodes that ended lately: as many as there are environments, at least 200.

    Plain data: it is part of a checkpoint.
    """

    window: int
    returns: deque[float] = field(default_factory=deque)
    successes: deque[float] = field(default_factory=deque)
    terms: dict[str, deque[float]] = field(default_factory=dict)

    @classmethod
    def of(cls, num_envs: int, terms: list[str]) -> Latest:
        """Returns an empty record for rewards named `terms`."""
        window = max(_MIN_WINDOW, num_envs)
        return cls(
            window,
            deque(maxlen=window),
            deque(maxlen=window),
            {name: deque(maxlen=window) for name in terms},
        )

    def add(self, info: dict[str, Any]) -> None:
        """Adds the episodes in an info of `TaskVectorEnv`."""
        if "_end" not in info:
            return
        over = info["_end"]
        self.returns.extend(info["episode_return"][over].tolist())
        self.successes.extend(info["success"][over].tolist())
        for name, sums in info["reward_terms"].items():
            self.terms[name].extend(sums[over].tolist())

    @property
    def mean_return(self) -> float:
        """Mean return; not a number before the first end."""
        return _mean(self.returns)

    @property
    def success(self) -> float:
        """Fraction of successes; not a number before the first end."""
        return _mean(self.successes)

    def mean_terms(self) -> dict[str, float]:
        """Returns the mean sum of each reward."""
        return {name: _mean(sums) for name, sums in self.terms.items()}


@dataclass(frozen=True)
class CurvePoint:
    """State of a training at one evaluation."""

    steps: int
    seconds: float
    """Wall time since the start of the training, s, without interruptions."""
    success: float
    """Fraction of greedy episodes on validation seeds that succeed."""
    mean_return: float
    """Mean return of the same episodes."""


@dataclass(frozen=True)
class EpisodesPoint:
    """Results of a training's own episodes, with exploration, at one time."""

    steps: int
    success: float
    mean_return: float
    """Not a number before the first end."""


def _mean(values: deque[float]) -> float:
    return float(np.mean(values)) if values else float("nan")
