"""Observations: functions return (K, n, size) numbers of all UAVs."""

from __future__ import annotations

from volery.autonomy.policy import observation_terms
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation

GOAL = "goal_map"
"""Name of the goals (K, n, 3), m, map, among the values of a flight."""


def goal_body(scale_m: float = 3.0, *, noise: float = 0.0) -> Observation:
    """Returns the goal relative to the UAV in the body frame (FLU), m."""
    return Observation("goal_body", _goal_body, 3, "m", scale_m, noise=noise)


def goal_heading(scale_m: float = 3.0, *, noise: float = 0.0) -> Observation:
    """Returns the goal relative to the UAV in the level heading frame, m."""
    return Observation("goal_heading", _goal_heading, 3, "m", scale_m, noise=noise)


def velocity_body(scale_m_s: float = 3.0, *, noise: float = 0.0) -> Observation:
    """Returns the velocity in the body frame (FLU), m/s."""
    return Observation("velocity_body", _velocity_body, 3, "m/s", scale_m_s, noise=noise)


def velocity_heading(scale_m_s: float = 3.0, *, noise: float = 0.0) -> Observation:
    """Returns the velocity in the level heading frame, m/s."""
    return Observation("velocity_heading", _velocity_heading, 3, "m/s", scale_m_s, noise=noise)


def rotation(*, noise: float = 0.0) -> Observation:
    """Returns the rotation matrix, map from body, row by row: no jump at any attitude."""
    return Observation("rotation", _rotation, 9, "1", noise=noise)


def rates(scale_rad_s: float = 6.0, *, noise: float = 0.0) -> Observation:
    """Returns the body rates, FLU, rad/s."""
    return Observation("rates", _rates, 3, "rad/s", scale_rad_s, noise=noise)


def last_action(size: int) -> Observation:
    """Returns the last action, `size` numbers of -1 to 1."""
    return Observation("last_action", lambda flight: flight.action, size, "1")


def _to_goal(flight: Flight) -> Array:
    return flight.values[GOAL] - flight.state.position_map


def _goal_body(flight: Flight) -> Array:
    return flight.to_body(_to_goal(flight))


def _goal_heading(flight: Flight) -> Array:
    return flight.to_heading(_to_goal(flight))


def _velocity_body(flight: Flight) -> Array:
    return flight.to_body(flight.state.velocity_map)


def _velocity_heading(flight: Flight) -> Array:
    return flight.to_heading(flight.state.velocity_map)


def _rotation(flight: Flight) -> Array:
    return observation_terms.rotation_rows(flight.state.attitude)


def _rates(flight: Flight) -> Array:
    return flight.state.omega_body
