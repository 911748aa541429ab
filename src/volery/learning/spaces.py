"""The Gymnasium spaces of a task, for one UAV."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box, Discrete, Space

from volery.learning.task import Task


def observation_space(task: Task) -> Box:
    """Returns the space of observations (D,): each part within its limit."""
    limits = [np.full(part.numbers, part.limit, np.float32) for part in task.observations]
    high = np.concatenate(limits)
    return Box(-high, high, dtype=np.float32)


def action_space(task: Task) -> Space[np.ndarray] | Space[np.int64]:
    """Returns the space of actions: (A,) from -1 to 1, or choices."""
    if task.action.choices is not None:
        return Discrete(task.action.choices)
    return Box(-1.0, 1.0, (task.action.size,), np.float32)
