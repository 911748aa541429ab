"""Rewards: functions return (K, n) numbers for each decision."""

from __future__ import annotations

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Reward
from volery.learning.terms.observations import GOAL


def distance(weight: float) -> Reward:
    """Returns the distance to the goal, m."""
    return Reward("distance", goal_distance, weight)


def nearness(weight: float, scale_m: float = 1.0) -> Reward:
    """Returns exp(-distance / scale): 1 at the goal, 0 far from it."""

    def near(flight: Flight) -> Array:
        return np.asarray(np.exp(-goal_distance(flight) / scale_m))

    return Reward("nearness", near, weight)


def approach(weight: float) -> Reward:
    """Returns the speed towards the goal, m/s."""

    def closing(flight: Flight) -> Array:
        to_goal = flight.values[GOAL] - flight.state.position_map
        along = np.sum(to_goal * flight.state.velocity_map, axis=-1)
        return np.asarray(along / np.maximum(np.linalg.norm(to_goal, axis=-1), 0.1))

    return Reward("approach", closing, weight)


def speed(weight: float) -> Reward:
    """Returns the speed, m/s."""
    return Reward("speed", lambda f: np.linalg.norm(f.state.velocity_map, axis=-1), weight)


def tilt(weight: float) -> Reward:
    """Returns 1 - cosine of the tilt: 0 upright, 2 upside down."""
    return Reward("tilt", lambda f: 1.0 - up_cosine(f), weight)


def spin(weight: float) -> Reward:
    """Returns the body rate, rad/s."""
    return Reward("spin", lambda f: np.linalg.norm(f.state.omega_body, axis=-1), weight)


def action_size(weight: float) -> Reward:
    """Returns the mean square of the action."""
    return Reward("action_size", lambda f: np.mean(f.action**2, axis=-1), weight)


def action_change(weight: float) -> Reward:
    """Returns the mean square of the change of the action."""

    def change(flight: Flight) -> Array:
        return np.asarray(np.mean((flight.action - flight.previous_action) ** 2, axis=-1))

    return Reward("action_change", change, weight)


def alive(weight: float) -> Reward:
    """Returns 1 in each decision."""
    return Reward("alive", lambda f: np.ones((f.num_envs, f.num_uavs)), weight)


def goal_distance(flight: Flight) -> Array:
    """Returns the distance to the goal (K, n), m."""
    to_goal = flight.values[GOAL] - flight.state.position_map
    return np.asarray(np.linalg.norm(to_goal, axis=-1))


def up_cosine(flight: Flight) -> Array:
    """Returns the cosine of the tilt (K, n)."""
    return np.asarray(rotations.rotate(flight.state.attitude, [0.0, 0.0, 1.0])[..., 2])
