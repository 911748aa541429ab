"""Follow a fast trajectory, another one in every episode, by body rates and thrust at 50 Hz."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.learning.actions import RatesThrust
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms import observations, rewards, starts, terminations, trajectories
from volery.learning.terms.observations import GOAL
from volery.learning.terms.trajectories import CURVE, ERROR
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

_CENTRE = (0.0, 0.0, 10.0)
_BOUND_M = 0.1
"""Mean error of a success."""


def tracking() -> Task:
    """Returns the task."""
    return Task(
        "tracking",
        "Follow a fast trajectory by body rates and thrust",
        scenario=lambda: open_air("hummingbird", physics_hz=500, guidance_hz=100),
        action=RatesThrust(5.0),
        observations=(
            trajectories.reference_ahead((0.0, 0.1, 0.2, 0.4)),
            observations.velocity_body(3.0),
            observations.rotation(),
            observations.rates(5.0),
            observations.last_action(4),
        ),
        rewards=(
            rewards.nearness(1.0, 0.3),
            rewards.distance(-0.1),
            rewards.spin(-0.01),
            rewards.action_change(-0.1),
        ),
        terminations=(terminations.out_of_range(3.0), terminations.crashed()),
        begin=_begin,
        advance=trajectories.follow,
        decision_rate_hz=50.0,
        episode_s=8.0,
        success=_follows,
        values={GOAL: (1, 3), CURVE: (4, 3), ERROR: (1,)},
    )


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    curves = trajectories.draw_curves(
        flight, envs, centre=_CENTRE, speed_m_s=(1.5, 3.5), amplitude_m=(1.5, 3.0)
    )
    position, velocity = trajectories.curve_motion(curves, np.zeros((len(envs), 1)))
    flight.values[CURVE][envs] = curves
    flight.values[GOAL][envs] = position
    flight.values[ERROR][envs] = 0.0
    return EnvironmentStart(
        position + starts.vectors_in_ball(flight, envs, 0.3),
        starts.tilted_attitudes(flight, envs, 0.2),
        velocity + starts.vectors_in_ball(flight, envs, 0.5),
    )


def _follows(flight: Flight) -> NDArray[np.bool_]:
    return np.asarray((trajectories.mean_error(flight) < _BOUND_M).all(axis=1))
