"""Trajectories to follow: Lissajous curves, drawn anew for each episode."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation
from volery.learning.terms.observations import GOAL

CURVE = "curve"
"""Name of the curves (K, 4, 3) among the values of a flight: for each axis of the map the centre m,
amplitude m, angular rate rad/s and phase rad."""
ERROR = "error_m"
"""Name of the errors (K, n) among the values of a flight: their sum since the first second."""
SETTLING_S = 1.0
"""Time after which errors count."""


def draw_curves(
    flight: Flight,
    envs: NDArray[np.int64],
    *,
    centre: Sequence[float],
    speed_m_s: tuple[float, float],
    amplitude_m: tuple[float, float],
) -> Array:
    """Draws curves (R, 4, 3) with peak speeds along x and y between two bounds.

    Along z amplitude and speed are a third of them.
    """
    scale = np.array([1.0, 1.0, 1.0 / 3.0])
    speed = flight.draws.uniform(envs, *speed_m_s, shape=(3,))
    amplitude = flight.draws.uniform(envs, *amplitude_m, shape=(3,))
    phase = flight.draws.uniform(envs, -math.pi, math.pi, (3,))
    middle = np.broadcast_to(np.asarray(centre, np.float64), phase.shape)
    return np.stack([middle, amplitude * scale, speed / amplitude, phase], axis=1)


def curve_motion(curves: Array, time_s: Array) -> tuple[Array, Array]:
    """Returns positions, m, and velocities, m/s, (R, T, 3), map, at times (R, T), s."""
    centre, amplitude, rate, phase = np.moveaxis(curves[:, :, None], 1, 0)
    angle = rate * time_s[..., None] + phase
    return centre + amplitude * np.sin(angle), amplitude * rate * np.cos(angle)


def reference_ahead(ahead_s: Sequence[float], scale_m: float = 2.0) -> Observation:
    """Returns points of the trajectory after some times, relative to the UAV in the body frame, m.

    Their velocities follow from the distances between them.
    """
    return Observation(
        "reference_body",
        _reference_body(tuple(ahead_s)),
        3 * len(ahead_s),
        "m",
        scale_m,
        parameters={"ahead_s": [float(time) for time in ahead_s]},
    )


def follow(flight: Flight) -> None:
    """Moves the goal along the curve, and sums up errors; a task's `advance`."""
    time_s = flight.decisions / flight.decision_rate_hz
    position, _ = curve_motion(flight.values[CURVE], time_s[:, None])
    flight.values[GOAL][:] = position
    error = np.linalg.norm(position - flight.state.position_map, axis=-1)
    flight.values[ERROR] += error * (time_s > SETTLING_S)[:, None]


def mean_error(flight: Flight) -> Array:
    """Returns the mean error (K, n), m, since the first second of the episode."""
    settling = round(SETTLING_S * flight.decision_rate_hz)
    return flight.values[ERROR] / np.maximum(flight.decisions - settling, 1)[:, None]


def _reference_body(ahead_s: tuple[float, ...]) -> Callable[[Flight], Array]:
    ahead = np.array(ahead_s)

    def function(flight: Flight) -> Array:
        time_s = flight.decisions[:, None] / flight.decision_rate_hz + ahead
        points, _ = curve_motion(flight.values[CURVE], time_s)
        own = flight.state.position_map
        parts = [flight.to_body(points[:, t, None] - own) for t in range(len(ahead))]
        return np.concatenate(parts, axis=-1)

    return function
