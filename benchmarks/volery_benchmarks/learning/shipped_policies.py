"""Measures the policies that ship: in their tasks, and in the full simulation."""

from __future__ import annotations

from volery.autonomy.policy.shipped_policies import shipped_policies
from volery.core.errors import VoleryError
from volery.learning.tasks import load_task
from volery.learning.training import evaluate
from volery.learning.transfer import fly_transfer
from volery_benchmarks.registry import Measured

_EPISODES = 200
_FLOWN_BY = {"hover": "late_hover"}
"""Policies of tasks whose own one is trained without latency, which the full simulation has."""


def measure_success() -> Measured:
    """Returns the success of each shipped policy in 200 episodes that no training uses."""
    figures = {
        f"success_{name}": evaluate(name, episodes=_EPISODES).success for name in shipped_policies()
    }
    return Measured(figures)


def measure_transfer() -> Measured:
    """Returns the success of each shipped policy of one UAV in the full simulation.

    With sensor noise, the estimator and 20 ms of latency. Hover is flown by the policy
    `late_hover`: one that is trained without latency fails with it.
    """
    figures, failures = {}, {}
    for name in shipped_policies():
        if name in _FLOWN_BY.values():
            continue
        try:
            policy = _FLOWN_BY.get(name, name)
            found = fly_transfer(policy, load_task(name), episodes=_EPISODES)
        except VoleryError as error:
            failures[f"transfer_{name}"] = str(error)
            continue
        figures[f"transfer_{name}"] = found.success
    return Measured(figures, failures)
