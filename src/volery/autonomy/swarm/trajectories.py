"""Trajectories of a swarm that keep apart in space and time, planned one after the other.

Each UAV has a committed trajectory, a quintic that ends at rest, and plans a new one several times
a second: of trajectories to points around its preferred path it commits to the best one that keeps
its distance from obstacles and from the committed trajectories of its neighbours at all times.
Where it finds none, it flies on along its old one, from which later plans of others keep away. So
committed trajectories never cross, as in MADER (J. Tordesillas, J. How, IEEE T-RO 2022) and
EGO-Swarm (X. Zhou et al., ICRA 2021), which optimize splines instead of choosing among samples.

UAVs that have arrived would block those behind; as with ORCA, a UAV prefers to be out of the way of
neighbours that prefer to fly faster.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.swarm.behaviour import Flock, Surroundings
from volery.autonomy.swarm.velocity_choice import give_way
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel
from volery.core.saved_state import SavedAttributes

_TURNS = (0.0, -0.26, 0.26, -0.52, 0.52, -0.79, 0.79, -1.2, 1.2, -1.7, 1.7, 2.6, -2.6)
"""Turns of paths from the preferred one, rad; right ones first."""
_PARTS = (1.0, 0.7, 0.4, 0.15)
"""Lengths of paths, relative to the preferred one."""
_LENGTH = 0.6
"""Length of a path, relative to speed times duration: a quintic that starts at that speed and ends
at rest after this length keeps the speed at first."""
_SAMPLES = 20
"""Times at which trajectories are compared."""
_TURN_COST, _CHANGE_COST = 0.25, 0.1
"""Cost of a turn from the preferred path, and of a change of the turn, per rad."""
_EPSILON_M = 1e-3


class TrajectorySettings(NamedTuple):
    """Parameters of the planning."""

    distance_m: float = 2.0
    """Minimum distance between the trajectories of two UAVs at each time."""
    obstacle_m: float = 1.0
    """Minimum distance of a trajectory from obstacles."""
    duration_s: float = 4.0
    """Duration of a trajectory."""
    period_s: float = 0.05
    """Time between two calls of `velocities`."""
    calls: int = 4
    """Calls between two plans of a UAV."""
    tracking_gain: float = 1.0
    """Velocity per distance from the trajectory, 1/s."""
    lost_m: float = 1.5
    """Distance from its trajectory at which a UAV gets a new one, from where it is."""
    give_way_s: float = 1.0
    """Time ahead in which a UAV is out of the way of those that prefer to fly faster."""
    max_speed_m_s: float = 5.0


class _Committed(NamedTuple):
    """Committed trajectories of N UAVs."""

    curves: Any
    """(N, 2, 6): coefficients of x and y by powers of the time since the start."""
    start_s: Any
    """(N,): times of their starts."""
    turn: Any
    """(N,): turns from the preferred paths, rad."""


class Trajectories(SavedAttributes):
    """Plans trajectories that keep apart; implements `SwarmBehaviour`."""

    STATE = ("_time_s", "_calls", "_committed")

    def __init__(self, settings: TrajectorySettings | None = None) -> None:
        self.settings = chosen = settings or TrajectorySettings()
        self.radius_m = chosen.distance_m + 2.0 * chosen.max_speed_m_s * chosen.duration_s * _LENGTH
        self._time_s, self._calls = 0.0, 0
        self._committed = _none(0)

    def velocities(self, flock: Flock, preferred: Array, around: Surroundings) -> Array:
        """Returns commanded velocities (N, 2) m/s; call it each `period_s`."""
        count = len(flock.position)
        if len(self._committed.start_s) != count:
            self._committed = _none(count)
        wanted = np.empty((count, 2))
        self._calls += 1
        self._time_s = self._calls * self.settings.period_s
        _plan_all(
            *flock,
            np.ascontiguousarray(preferred, float),
            *around,
            self.settings,
            self._committed,
            self._calls,
            self._time_s,
            wanted,
        )
        return wanted


def _none(count: int) -> _Committed:
    """Returns trajectories that no UAV is near: each gets its first one."""
    return _Committed(np.full((count, 2, 6), np.inf), np.zeros(count), np.zeros(count))


@kernel
def _plan_all(
    position: Any,
    velocity: Any,
    first: Any,
    neighbour: Any,
    preferred: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: TrajectorySettings,
    committed: _Committed,
    calls: int,
    now_s: float,
    wanted: Any,
) -> None:
    """Renews committed trajectories and fills the velocities (N, 2) along them."""
    count, max_planes = len(position), 0
    trial = np.empty((2, 6))
    for i in range(count):
        x, y = _at(committed.curves[i], now_s - committed.start_s[i], settings.duration_s, 0)
        if not math.hypot(x - position[i, 0], y - position[i, 1]) < settings.lost_m:
            for axis in range(2):
                speed = velocity[i, axis]
                end = position[i, axis] + 0.5 * _LENGTH * settings.duration_s * speed
                start = position[i, axis]
                _fill(committed.curves[i], axis, start, speed, 0.0, end, settings.duration_s)
            committed.start_s[i], committed.turn[i] = now_s, 0.0
        max_planes = max(max_planes, first[i + 1] - first[i])
    planes, relaxed = np.empty((max_planes, 3)), np.empty((max_planes, 3))
    for i in range(count):
        if (calls + i) % settings.calls == 0:
            near = neighbour[first[i] : first[i + 1]]
            _, vx, vy = give_way(
                position, preferred, i, near, settings.distance_m, settings.give_way_s,
                settings.give_way_s, settings.max_speed_m_s, planes, relaxed,
            )  # fmt: skip
            _plan(
                i, vx, vy, position, near, arena, cylinders, echoes, settings, committed, now_s,
                trial,
            )  # fmt: skip
    for i in range(count):
        since_s = now_s - committed.start_s[i]
        x, y = _at(committed.curves[i], since_s, settings.duration_s, 0)
        vx, vy = _at(committed.curves[i], since_s, settings.duration_s, 1)
        wanted[i, 0] = vx + settings.tracking_gain * (x - position[i, 0])
        wanted[i, 1] = vy + settings.tracking_gain * (y - position[i, 1])


@inner_kernel
def _plan(
    i: int,
    preferred_x: float,
    preferred_y: float,
    position: Any,
    near: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: TrajectorySettings,
    committed: _Committed,
    now_s: float,
    trial: Any,
) -> None:
    """Commits UAV i to the best trajectory that is free, if there is one."""
    since_s, duration = now_s - committed.start_s[i], settings.duration_s
    x, y = _at(committed.curves[i], since_s, duration, 0)
    vx, vy = _at(committed.curves[i], since_s, duration, 1)
    ax, ay = _at(committed.curves[i], since_s, duration, 2)
    speed = min(math.hypot(preferred_x, preferred_y), settings.max_speed_m_s)
    heading = math.atan2(preferred_y, preferred_x)
    length = _LENGTH * duration * speed
    best, best_turn, best_part = math.inf, 0.0, -1.0
    for turn in _TURNS:
        for part in _PARTS:
            cost = 1.0 - part * math.cos(turn) + _TURN_COST * abs(turn)
            cost += _CHANGE_COST * abs(turn - committed.turn[i])
            if cost >= best:
                continue
            ex = x + part * length * math.cos(heading + turn)
            ey = y + part * length * math.sin(heading + turn)
            _fill(trial, 0, x, vx, ax, ex, duration)
            _fill(trial, 1, y, vy, ay, ey, duration)
            if _is_free(
                i, trial, position, near, arena, cylinders, echoes, settings, committed, now_s
            ):
                best, best_turn, best_part = cost, turn, part
    if best_part < 0.0:
        return
    ex = x + best_part * length * math.cos(heading + best_turn)
    ey = y + best_part * length * math.sin(heading + best_turn)
    _fill(committed.curves[i], 0, x, vx, ax, ex, duration)
    _fill(committed.curves[i], 1, y, vy, ay, ey, duration)
    committed.start_s[i], committed.turn[i] = now_s, best_turn


@inner_kernel
def _is_free(
    i: int,
    trial: Any,
    position: Any,
    near: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: TrajectorySettings,
    committed: _Committed,
    now_s: float,
) -> bool:
    """Returns whether a trajectory from now on keeps its distances, or does not lessen them."""
    duration = settings.duration_s
    x0, y0 = _at(trial, 0.0, duration, 0)
    for k in range(1, _SAMPLES + 1):
        after_s = k * duration / _SAMPLES
        x, y = _at(trial, after_s, duration, 0)
        vx, vy = _at(trial, after_s, duration, 1)
        if math.hypot(vx, vy) > settings.max_speed_m_s:
            return False
        if not _is_clear(i, x, y, x0, y0, position, arena, cylinders, echoes, settings.obstacle_m):
            return False
        for j in near:
            since_s = now_s - committed.start_s[j]
            ox, oy = _at(committed.curves[j], since_s, duration, 0)
            px, py = _at(committed.curves[j], since_s + after_s, duration, 0)
            min_distance = min(settings.distance_m, math.hypot(x0 - ox, y0 - oy)) - _EPSILON_M
            if math.hypot(x - px, y - py) < min_distance:
                return False
    return True


@inner_kernel
def _is_clear(
    i: int,
    x: float,
    y: float,
    x0: float,
    y0: float,
    position: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    min_distance: float,
) -> bool:
    """Returns whether a point keeps its distance from obstacles, or that of the start (x0, y0)."""
    inside = min(x - arena[0], y - arena[1], arena[2] - x, arena[3] - y)
    before = min(x0 - arena[0], y0 - arena[1], arena[2] - x0, arena[3] - y0)
    if inside < min(min_distance, before) - _EPSILON_M:
        return False
    for k in range(len(cylinders)):
        cx, cy, radius = cylinders[k, 0], cylinders[k, 1], cylinders[k, 2]
        before = math.hypot(x0 - cx, y0 - cy) - radius
        if math.hypot(x - cx, y - cy) - radius < min(min_distance, before) - _EPSILON_M:
            return False
    for k in range(echoes.shape[1]):
        cx, cy = position[i, 0] + echoes[i, k, 0], position[i, 1] + echoes[i, k, 1]
        before = math.hypot(x0 - cx, y0 - cy)
        if math.hypot(x - cx, y - cy) < min(min_distance, before) - _EPSILON_M:  # never for nan
            return False
    return True


@inner_kernel
def _fill(curve: Any, axis: int, p: float, v: float, a: float, end: float, duration: float) -> None:
    """Fills a quintic from position, velocity and acceleration to rest at `end`."""
    t = duration
    d = end - p
    curve[axis, 0], curve[axis, 1], curve[axis, 2] = p, v, 0.5 * a
    curve[axis, 3] = (20.0 * d - 12.0 * v * t - 3.0 * a * t * t) / (2.0 * t**3)
    curve[axis, 4] = (-30.0 * d + 16.0 * v * t + 3.0 * a * t * t) / (2.0 * t**4)
    curve[axis, 5] = (12.0 * d - 6.0 * v * t - a * t * t) / (2.0 * t**5)


@inner_kernel
def _at(curve: Any, since_s: float, duration: float, order: int) -> tuple[float, float]:
    """Returns x and y of a trajectory, or of its first or second derivative, after a time."""
    t = min(max(since_s, 0.0), duration)
    return _value(curve[0], t, order), _value(curve[1], t, order)


@inner_kernel
def _value(c: Any, t: float, order: int) -> float:
    value: float
    if order == 0:
        value = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    elif order == 1:
        value = c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])))
    else:
        value = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]))
    return value
