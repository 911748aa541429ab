"""Terms of tasks that end with a touchdown on a goal on the ground; one UAV or more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Reward, Termination
from volery.learning.terms.observations import GOAL

MOTION = "landing_motion"
"""Name of the values (K, n, 12) of the present decision and the one before, which the task's
`advance` stores by `store_motion` and its `begin` by `begin_motion`. Each has the vector from the
UAV to the goal, m, and the velocity, m/s, map."""


def begin_motion(flight: Flight, envs: NDArray[np.int64], to_goal: Array, velocity: Array) -> None:
    """Stores the motion at the start of episodes of `envs` (R,); arrays (R, n, 3), map."""
    flight.values[MOTION][envs] = np.concatenate([to_goal, velocity] * 2, axis=-1)


def store_motion(flight: Flight) -> None:
    """Stores the motion at the present decision; a part of `advance`."""
    kept = flight.values[MOTION]
    kept[..., :6] = kept[..., 6:]
    kept[..., 6:9] = flight.values[GOAL] - flight.state.position_map
    kept[..., 9:] = flight.state.velocity_map


def horizontal_approach(weight: float) -> Reward:
    """Returns by how much the horizontal distance to the goal shrank, m."""

    def shrank(flight: Flight) -> Array:
        before = np.linalg.norm(flight.values[MOTION][..., :2], axis=-1)
        return np.asarray(before - horizontal_distance(flight))

    return Reward("horizontal_approach", shrank, weight)


def descent(weight: float) -> Reward:
    """Returns by how much the height above the goal shrank, m."""

    def shrank(flight: Flight) -> Array:
        before, now = flight.values[MOTION][..., 2], flight.values[MOTION][..., 8]
        return np.asarray(np.abs(before) - np.abs(now))

    return Reward("descent", shrank, weight)


def touchdown_nearness(weight: float, scale_m: float = 0.1) -> Reward:
    """Returns exp(-horizontal distance / scale) in the decision of the touchdown, else 0."""

    def near(flight: Flight) -> Array:
        return np.asarray(flight.state.on_ground * np.exp(-horizontal_distance(flight) / scale_m))

    return Reward("touchdown_nearness", near, weight)


def touchdown_speed(weight: float) -> Reward:
    """Returns the speed before the touchdown, m/s, in the decision of the touchdown, else 0."""
    return Reward("touchdown_speed", lambda f: f.state.on_ground * speed_before(f), weight)


def landed(within_m: float, speed_limit_m_s: float, reward: float = 10.0) -> Termination:
    """Ends the episode with success when all UAVs are on the ground near their goals.

    within_m: horizontal distance; speed_limit_m_s: maximum speed before the touchdown.
    """

    def down(flight: Flight) -> NDArray[np.bool_]:
        state = flight.state
        is_near = horizontal_distance(flight) <= within_m
        is_soft = speed_before(flight) <= speed_limit_m_s
        return np.asarray((state.on_ground & ~state.crashed & is_near & is_soft).all(axis=1))

    return Termination("landed", down, is_success=True, reward=reward)


def horizontal_distance(flight: Flight) -> Array:
    """Returns the horizontal distances (K, n) to the goals, m."""
    return np.asarray(np.linalg.norm(flight.values[MOTION][..., 6:8], axis=-1))


def speed_before(flight: Flight) -> Array:
    """Returns the speeds (K, n), m/s, at the decision before the present one."""
    return np.asarray(np.linalg.norm(flight.values[MOTION][..., 3:6], axis=-1))
