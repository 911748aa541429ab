"""Fly to a target that is elsewhere in every episode, by seven discrete velocities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.learning.actions import DiscreteVelocity
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms import observations, rewards, starts, terminations
from volery.learning.terms.observations import GOAL
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

_CENTRE = np.array([0.0, 0.0, 10.0])


def homing() -> Task:
    """Returns the task."""
    return Task(
        "homing",
        "Fly to a target whose position is known, by discrete velocities",
        scenario=lambda: open_air("f450", physics_hz=500, guidance_hz=100),
        action=DiscreteVelocity(1.0),
        observations=(observations.goal_heading(3.0), observations.velocity_heading(1.0)),
        rewards=(rewards.approach(0.1), rewards.alive(-0.01)),
        terminations=(
            terminations.arrived(0.3, 1.5, reward=5.0),
            terminations.crashed(-5.0),
            terminations.out_of_range(8.0, -5.0),
        ),
        begin=_begin,
        decision_rate_hz=5.0,
        episode_s=15.0,
        values={GOAL: (1, 3)},
    )


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    flight.values[GOAL][envs] = _CENTRE + starts.vectors_in_ball(flight, envs, 3.0)
    return EnvironmentStart(np.broadcast_to(_CENTRE, (len(envs), 1, 3)))
