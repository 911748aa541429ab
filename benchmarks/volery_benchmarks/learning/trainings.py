"""Measures the wall time of trainings of shipped tasks, with their shipped configurations."""

from __future__ import annotations

import statistics

from volery.learning.training import evaluate, train
from volery_benchmarks.registry import Measured

_SEEDS = range(5)
_EPISODES = 500
"""Episodes, on seeds never trained on, in which each trained policy is evaluated."""


def measure_hover() -> Measured:
    """Returns the time of a training of `hover`, median of five seeds."""
    return _training("hover", 0.99)


def measure_homing() -> Measured:
    """Returns the time of a training of `homing`, median of five seeds."""
    return _training("homing", 0.98)


def _training(task: str, target: float) -> Measured:
    """Returns the median time, and the lowest success of the trained policies.

    A training that misses `target` on its own evaluation is listed as a failure.
    """
    seconds, successes, failures = [], [], {}
    for seed in _SEEDS:
        result = train(task, seed=seed)
        seconds.append(result.seconds)
        successes.append(evaluate(result.policy, episodes=_EPISODES).success)
        if result.success < target:
            failures[f"train_s_{task} of seed {seed}"] = f"success {result.success:.1%} at most"
    figures = {
        f"train_s_{task}": statistics.median(seconds),
        f"train_s_{task}_most": max(seconds),
        f"train_success_{task}_least": min(successes),
    }
    return Measured(figures, failures)
