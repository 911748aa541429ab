"""Hover with an unknown mass, slower motors, noisy observations and late actions.

The same flight as `hover`; a policy that masters it keeps flying with 20 ms of latency.
"""

from __future__ import annotations

from dataclasses import replace

from volery.learning import randomization
from volery.learning.task import Task
from volery.learning.tasks.hover import hover
from volery.learning.terms import observations


def late_hover() -> Task:
    """Returns the task."""
    easy = hover()
    return replace(
        easy,
        name="late_hover",
        description="Hover with an unknown mass, noise and latency, commanding the rotors",
        observations=(
            observations.goal_body(1.0, noise=0.01),
            observations.velocity_body(2.0, noise=0.03),
            observations.rotation(noise=0.01),
            observations.rates(10.0, noise=0.05),
            replace(observations.last_action(4), history=3),
        ),
        action_latency_s=(0.0, 0.02),
        randomization=(
            randomization.mass(0.9, 1.1),
            randomization.motor_delay(0.8, 1.2),
            randomization.noise_scale(0.0, 1.0),
        ),
    )
