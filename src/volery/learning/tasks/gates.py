"""Fly through five gates in order, elsewhere in every episode, by velocities at 25 Hz."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.learning.actions import Velocity
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms import gates as course
from volery.learning.terms import observations, rewards, starts, terminations
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

_NUM_GATES = 5
_START = np.array([0.0, 0.0, 4.0])


def gates() -> Task:
    """Returns the task."""
    return Task(
        "gates",
        "Fly through five gates in order",
        scenario=lambda: open_air("hummingbird", physics_hz=500, guidance_hz=125),
        action=Velocity(speed_m_s=4.0, yaw_rate_rad_s=2.0),
        observations=(
            course.gates_heading(2, 5.0),
            course.gate_directions_heading(2),
            observations.velocity_heading(4.0),
            observations.last_action(4),
        ),
        rewards=(
            course.progress(0.5),
            course.gate_passed(3.0),
            rewards.alive(-0.03),
            rewards.action_change(-0.02),
        ),
        terminations=(
            course.finished(5.0),
            course.frame_hit(-6.0),
            terminations.crashed(-6.0),
            terminations.out_of_range(10.0, -6.0),
        ),
        begin=_begin,
        advance=course.race(course.Frame()),
        decision_rate_hz=25.0,
        episode_s=15.0,
        values=course.gate_values(_NUM_GATES),
    )


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    heading = course.draw_gates(flight, envs, _NUM_GATES, start_map=_START)
    yaw = heading + flight.draws.uniform(envs, -0.5, 0.5)
    return EnvironmentStart(
        np.broadcast_to(_START, (len(envs), 1, 3)),
        rotations.from_yaw(yaw)[:, None],
        starts.vectors_in_ball(flight, envs, 0.5),
    )
