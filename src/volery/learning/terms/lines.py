"""Terms of flights along a straight line among obstacles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation, Reward, Termination

LINE = "line_map"
"""Name of the lines to follow (K, n, 4) among the values of a flight: start x, y (m) and unit
direction x, y, map."""


def line_offset(scale_m: float = 10.0, *, limit: float = 2.0) -> Observation:
    """Returns the lateral distance from the line, m, positive to its left."""
    return Observation("line_offset", lateral_m, 1, "m", scale_m, limit)


def progress(weight: float, max_speed_m_s: float = float("inf")) -> Reward:
    """Returns the speed along the line, m/s, at most `max_speed_m_s`, times the decision's length.

    Without a limit this is the distance along the line since the last decision, m.
    """

    def gained(flight: Flight) -> Array:
        speed = np.minimum(_along(flight, flight.state.velocity_map), max_speed_m_s)
        return speed / flight.decision_rate_hz

    return Reward("progress", gained, weight)


def too_slow(weight: float, speed_m_s: float) -> Reward:
    """Returns by how much the speed along the line is below `speed_m_s`, m/s."""

    def missing(flight: Flight) -> Array:
        return np.maximum(speed_m_s - _along(flight, flight.state.velocity_map), 0.0)

    return Reward("too_slow", missing, weight)


def clearance(weight: float, observation: Observation, *, near: float) -> Reward:
    """Returns how near the nearest echo is: 0 to 1 from closeness `near` to 1.

    observation: a part that holds closeness, of a LIDAR or a depth camera.
    """

    def nearness(flight: Flight) -> Array:
        nearest = observation.function(flight).max(axis=-1)
        return np.asarray(np.maximum(nearest - near, 0.0) / (1.0 - near), np.float64)

    return Reward("clearance", nearness, weight)


def crossed(length_m: float, reward: float) -> Termination:
    """Ends the episode with success when all UAVs are `length_m` along their lines."""

    def is_across(flight: Flight) -> NDArray[np.bool_]:
        return np.asarray((along_m(flight) >= length_m).all(axis=1))

    return Termination("crossed", is_across, is_success=True, reward=reward)


def along_m(flight: Flight) -> Array:
    """Returns the distance along the line (K, n), m."""
    return _along(flight, flight.state.position_map, from_start=True)


def lateral_m(flight: Flight) -> Array:
    """Returns the lateral distance from the line (K, n, 1), m."""
    line = flight.values[LINE]
    away = flight.state.position_map[..., :2] - line[..., :2]
    return np.asarray(line[..., 2:3] * away[..., 1:2] - line[..., 3:4] * away[..., 0:1])


def _along(flight: Flight, vectors_map: Array, *, from_start: bool = False) -> Array:
    line = flight.values[LINE]
    horizontal = vectors_map[..., :2] - (line[..., :2] if from_start else 0.0)
    return np.asarray((horizontal * line[..., 2:]).sum(axis=-1))
