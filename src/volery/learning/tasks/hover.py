"""Hover at a point from any position near it, any velocity and any attitude within 60 degrees.

The policy commands the rotors at 100 Hz, without any controller below it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.learning.actions import RotorSpeeds
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms import observations, rewards, starts, terminations
from volery.learning.terms.observations import GOAL
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

_CENTRE = np.array([0.0, 0.0, 10.0])


def hover() -> Task:
    """Returns the task."""
    return Task(
        "hover",
        "Recover from a throw and hover at a point, commanding the rotors",
        scenario=lambda: open_air("crazyflie", physics_hz=500, guidance_hz=100),
        action=RotorSpeeds(),
        observations=(
            observations.goal_body(1.0),
            observations.velocity_body(2.0),
            observations.rotation(),
            observations.rates(10.0),
            observations.last_action(4),
        ),
        rewards=(
            rewards.nearness(1.0, 0.7),
            rewards.alive(0.2),  # an early end must not pay
            rewards.speed(-0.05),
            rewards.tilt(-0.2),
            rewards.spin(-0.02),
            rewards.action_change(-0.05),
        ),
        terminations=(terminations.out_of_range(5.0), terminations.crashed()),
        begin=_throw,
        decision_rate_hz=100.0,
        episode_s=5.0,
        success=_hovers,
        values={GOAL: (1, 3)},
    )


def _throw(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    flight.values[GOAL][envs] = _CENTRE
    return EnvironmentStart(
        _CENTRE + starts.vectors_in_ball(flight, envs, 1.0),
        starts.tilted_attitudes(flight, envs, math.radians(60.0)),
        starts.vectors_in_ball(flight, envs, 1.0),
        starts.vectors_in_ball(flight, envs, 2.0),
    )


def _hovers(flight: Flight) -> NDArray[np.bool_]:
    near = rewards.goal_distance(flight) < 0.2
    slow = np.linalg.norm(flight.state.velocity_map, axis=-1) < 0.3
    return np.asarray((near & slow).all(axis=1))
