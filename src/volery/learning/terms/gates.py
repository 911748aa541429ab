"""Square gates to fly through in order; their frames are geometry of each environment.

A gate is upright. Its direction is its x axis, horizontal; y and z span its opening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy.gate_terms import directions, in_gates, off_centre, passes
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation, Reward, Termination
from volery.learning.terms.observations import GOAL

GATES = "gates"
"""Name of the gates (K, G, 4) among the values of a flight: centre x, y, z, m, and yaw, rad, map.
The last one is no gate, but a point to head for behind the last gate."""
NEXT = "next_gate"
"""Name of the number (K, n) of each UAV's next gate."""
_LAST = "last_position_map"
_PROGRESS = "progress_m"
_PASSED = "passed_gate"
_HIT = "frame_hit"


@dataclass(frozen=True)
class Frame:
    """The shape of all gates, m."""

    opening_m: float = 1.6
    border_m: float = 0.25
    depth_m: float = 0.1


def gate_values(num_gates: int) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of the `values` that these terms need, for one UAV."""
    return {
        GOAL: (1, 3),
        GATES: (num_gates + 1, 4),
        NEXT: (1,),
        _LAST: (1, 3),
        _PROGRESS: (1,),
        _PASSED: (1,),
        _HIT: (1,),
    }


def draw_gates(
    flight: Flight,
    envs: NDArray[np.int64],
    num_gates: int,
    *,
    start_map: Array,
    distance_m: tuple[float, float] = (4.0, 6.0),
    turn_rad: float = math.radians(45.0),
    height_m: float = 0.7,
) -> Array:
    """Places gates one after the other from `start_map` (3,); returns headings (R,) to the first.

    The path turns by up to `turn_rad` at each gate; heights differ by up to `height_m` from the
    start's. Gates face along the path within 15 degrees.
    """
    draw, count = flight.draws.uniform, num_gates + 1
    first = draw(envs, -math.pi, math.pi, (1,))
    turns = draw(envs, -turn_rad, turn_rad, (count,))
    turns[:, 0] = 0.0
    heading = first + np.cumsum(turns, axis=1)
    steps = draw(envs, *distance_m, shape=(count,))
    gates = np.empty((len(envs), count, 4))
    gates[..., 0] = start_map[0] + np.cumsum(steps * np.cos(heading), axis=1)
    gates[..., 1] = start_map[1] + np.cumsum(steps * np.sin(heading), axis=1)
    gates[..., 2] = start_map[2] + draw(envs, -height_m, height_m, (count,))
    tilt = math.radians(15.0)
    gates[..., 3] = heading + draw(envs, -tilt, tilt, (count,))
    values = flight.values
    values[GATES][envs] = gates
    values[GOAL][envs] = gates[:, :1, :3]
    for name in (NEXT, _PROGRESS, _PASSED, _HIT):
        values[name][envs] = 0.0
    values[_LAST][envs] = start_map
    return np.asarray(first[:, 0])


def race(frame: Frame) -> Race:
    """Returns a task's `advance`: it finds passed gates and hit frames."""
    return Race(frame)


@dataclass(frozen=True)
class Race:
    """Finds out which gates UAVs pass, and whether they hit a frame, between two decisions."""

    frame: Frame

    def __call__(self, flight: Flight) -> None:
        """Updates the `values` of the flight."""
        values, frame = flight.values, self.frame
        radius = flight.airframe.body.collision_radius_m
        position, gates = flight.state.position_map, values[GATES]
        gates = gates[:, None]
        before, now = in_gates(values[_LAST], gates), in_gates(position, gates)
        number = values[NEXT].astype(np.int64)
        passed = np.take_along_axis(
            passes(before, now, frame.opening_m / 2.0 - radius), number[..., None], axis=2
        )[..., 0]
        values[_HIT][:] = _hits(before, now, frame, radius)[..., :-1].any(axis=2)
        values[_PROGRESS][:] = _distance(values[_LAST], values[GOAL])
        values[_PROGRESS] -= _distance(position, values[GOAL])
        values[_PASSED][:] = passed
        values[NEXT][:] = np.minimum(number + passed, gates.shape[2] - 1)
        values[GOAL][:] = _next(flight, 0)[..., :3]
        values[_LAST][:] = position


def gates_heading(count: int = 2, scale_m: float = 5.0) -> Observation:
    """Returns the centres of the next gates, relative to the UAV in its heading frame, m."""

    def function(flight: Flight) -> Array:
        own = flight.state.position_map
        ahead = [flight.to_heading(_next(flight, k)[..., :3] - own) for k in range(count)]
        return np.concatenate(ahead, axis=-1)

    name, parameters = "gates_heading", {"count": count}
    return Observation(name, function, 3 * count, "m", scale_m, parameters=parameters)


def gate_directions_heading(count: int = 2) -> Observation:
    """Returns the directions (x, y) of the next gates in the heading frame of the UAV."""

    def function(flight: Flight) -> Array:
        parts = []
        for k in range(count):
            yaw = _next(flight, k)[..., 3]
            parts.append(flight.to_heading(directions(yaw))[..., :2])
        return np.concatenate(parts, axis=-1)

    name, parameters = "gate_directions_heading", {"count": count}
    return Observation(name, function, 2 * count, "1", parameters=parameters)


def progress(weight: float) -> Reward:
    """Returns by how much the UAV came nearer to its next gate in this decision, m."""
    return Reward("progress", lambda flight: flight.values[_PROGRESS], weight)


def gate_passed(weight: float) -> Reward:
    """Returns 1 in the decision in which the UAV passes its next gate."""
    return Reward("gate_passed", lambda flight: flight.values[_PASSED], weight)


def frame_hit(reward: float = -5.0) -> Termination:
    """Ends the episode when a UAV hits the frame of a gate."""
    return Termination(
        "frame_hit",
        lambda flight: np.asarray((flight.values[_HIT] > 0.0).any(axis=1)),
        reward=reward,
    )


def finished(reward: float = 5.0) -> Termination:
    """Ends the episode with success when all UAVs have passed all gates."""

    def all_passed(flight: Flight) -> NDArray[np.bool_]:
        last = flight.values[GATES].shape[1] - 1
        return np.asarray((flight.values[NEXT] >= last).all(axis=1))

    return Termination("finished", all_passed, is_success=True, reward=reward)


def _next(flight: Flight, ahead: int) -> Array:
    """Returns the gate (K, n, 4) that is `ahead` after the next one, at most the last."""
    gates = flight.values[GATES]
    number = np.minimum(flight.values[NEXT].astype(np.int64) + ahead, gates.shape[1] - 1)
    return np.take_along_axis(gates, number[..., None], axis=1)


def _hits(before: Array, now: Array, frame: Frame, radius: float) -> NDArray[np.bool_]:
    inner = frame.opening_m / 2.0 - radius
    outer = frame.opening_m / 2.0 + frame.border_m + radius
    crosses = (before[..., 0] < 0.0) != (now[..., 0] < 0.0)
    off = off_centre(before, now)
    beside = np.abs(now[..., 0]) < frame.depth_m / 2.0 + radius
    present = np.abs(now[..., 1:]).max(axis=-1)
    meets = crosses & (off > inner) & (off < outer)
    return np.asarray(meets | (beside & (present > inner) & (present < outer)))


def _distance(position: Array, goal: Array) -> Array:
    return np.asarray(np.linalg.norm(goal - position, axis=-1))
