"""Keep a formation that moves through a field of posts, which is another in every episode.

Four UAVs follow the slots of a diamond. The frame of the diamond flies straight at a steady speed
and never waits; slots pass through posts, UAVs must go round them and come back. A touch of a post
or of another UAV fails the episode, for all.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.actions import LimitedVelocity
from volery.learning.curriculum import Curriculum
from volery.learning.flight import Flight
from volery.learning.task import Observation, Task, Termination
from volery.learning.terms import observations, posts, rewards, team
from volery.learning.terms.observations import GOAL
from volery.learning.terms.posts import BEFORE, POSTS, PRESENT
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

COURSE = "course"
"""Name of the course (K, 2) among the values: heading, rad, and speed, m/s, of the frame."""
ERROR = "slot_error"
"""Name of the summed distances to the slots (K, n), m, among the values."""
SLOTS = np.array([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, -2.0, 0.0], [-2.0, 0.0, 0.0]])
"""Slots (n, 3) of the diamond, m, in its frame: x along the course."""
MEAN_ERROR_M = 0.5
"""Largest mean distance to the slots of a success, m."""
_UAVS = len(SLOTS)
_HEIGHT = 10.0
_LENGTH = 28.0
_SPEEDS = (1.2, 2.0)
_POSTS = 8
_MAX_POSTS = 12
"""Posts of the last level of the curriculum, which is harder than the task."""
_LEVELS = ({"posts": 4}, {"posts": 8}, {"posts": _MAX_POSTS})
_FIELD = ((5.0, -3.5), (24.0, 3.5))
_RADII = (0.2, 0.5)
_GAP = 1.6


def formation() -> Task:
    """Returns the task."""
    return Task(
        "formation",
        "Keep a formation of four UAVs through posts",
        scenario=lambda: open_air("f450", physics_hz=500, guidance_hz=100, num_uavs=_UAVS),
        action=LimitedVelocity(3.0),
        observations=(
            observations.goal_heading(2.0),
            observations.velocity_heading(3.0),
            _frame_velocity(3.0),
            posts.nearest_posts(4, 2.0),
            team.nearest_neighbours(_UAVS - 1, num_agents=_UAVS),
        ),
        rewards=(
            rewards.alive(0.1),
            rewards.distance(-0.03),
            rewards.nearness(0.1, 0.7),
            posts.closeness(-0.2, 0.5),
            team.crowding(-0.2, 1.5, num_agents=_UAVS),
            rewards.action_change(-0.02),
        ),
        terminations=(
            _arrived(5.0),
            team.own_crash(-5.0),
            posts.touched(-5.0),
            _lost(-5.0),
        ),
        begin=_begin,
        decision_rate_hz=10.0,
        episode_s=30.0,
        values={
            GOAL: (_UAVS, 3),
            BEFORE: (_UAVS, 3),
            PRESENT: (_UAVS, 3),
            ERROR: (_UAVS,),
            COURSE: (2,),
            POSTS: (_MAX_POSTS, 3),
        },
        parameters={"posts": _POSTS},
        curriculum=Curriculum(_LEVELS, threshold=0.5, episodes=2),
        advance=_advance,
        num_agents=_UAVS,
    )


def mean_error(flight: Flight) -> Array:
    """Returns the mean distance (K,), m, of the UAVs to their slots in this episode."""
    decisions = np.maximum(flight.decisions, 1)
    return np.asarray(flight.values[ERROR].mean(axis=1) / decisions)


def progress(flight: Flight) -> Array:
    """Returns the distance (K,), m, that the frame has covered."""
    time_s = flight.decisions / flight.decision_rate_hz
    return np.asarray(np.minimum(flight.values[COURSE][:, 1] * time_s, _LENGTH))


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    values = flight.values
    course = flight.draws.uniform(envs, [-math.pi, _SPEEDS[0]], [math.pi, _SPEEDS[1]], (2,))
    values[COURSE][envs] = course
    heading = course[:, 0]
    number = flight.parameters["posts"][envs]
    field = posts.scattered_posts(
        flight, envs, number, low=_FIELD[0], high=_FIELD[1], radius_m=_RADII, gap_m=_GAP
    )
    values[POSTS][envs] = _along(field, heading)
    values[GOAL][envs] = _slots(np.zeros(len(envs)), heading)
    values[ERROR][envs] = 0.0
    position = values[GOAL][envs] + flight.draws.uniform(envs, -0.3, 0.3, (_UAVS, 3))
    values[PRESENT][envs] = position
    yaw = heading[:, None] + flight.draws.uniform(envs, -0.3, 0.3, (_UAVS,))
    zero = np.zeros_like(yaw)
    attitude = np.stack([zero, zero, np.sin(yaw / 2.0), np.cos(yaw / 2.0)], axis=-1)
    return EnvironmentStart(position, attitude)


def _advance(flight: Flight) -> None:
    values = flight.values
    values[GOAL][:] = _slots(progress(flight), values[COURSE][:, 0])
    posts.note_positions(flight)
    values[ERROR] += rewards.goal_distance(flight)


def _slots(covered: Array, heading: Array) -> Array:
    """Returns the slots (R, n, 3), m, map, of frames that have `covered` (R,) m."""
    slots = SLOTS + covered[:, None, None] * np.array([1.0, 0.0, 0.0])
    return np.asarray(_along(slots, heading) + np.array([0.0, 0.0, _HEIGHT]))


def _along(vectors: Array, heading: Array) -> Array:
    """Returns vectors (R, N, 3) along courses of `heading` (R,) in the map; z stays."""
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def _frame_velocity(scale_m_s: float) -> Observation:
    """Returns the velocity of the formation's frame in the level heading frame, m/s."""

    def seen(flight: Flight) -> Array:
        heading, speed = np.moveaxis(flight.values[COURSE], -1, 0)
        speed = np.where(progress(flight) < _LENGTH, speed, 0.0)
        along = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(speed)], axis=-1)
        velocity = (speed[:, None] * along)[:, None]
        return flight.to_heading(np.broadcast_to(velocity, (*velocity.shape[:1], _UAVS, 3)))

    return Observation("goal_velocity_heading", seen, 3, "m/s", scale_m_s)


def _arrived(reward: float) -> Termination:
    def there(flight: Flight) -> NDArray[np.bool_]:
        near = (rewards.goal_distance(flight) < 0.5).all(axis=1)
        return np.asarray(
            near & (progress(flight) >= _LENGTH) & (mean_error(flight) <= MEAN_ERROR_M)
        )

    return Termination("arrived", there, is_success=True, reward=reward)


def _lost(reward: float) -> Termination:
    """Ends the episode when a UAV is farther than 6 m from its slot, which costs this UAV."""

    def far(flight: Flight) -> NDArray[np.bool_]:
        return np.asarray(rewards.goal_distance(flight) > 6.0)

    return Termination("lost", far, reward=reward)
