"""Plans the next seconds of a flight several times a second; each plan ends at rest.

A new plan starts from the state that the current plan has when the new one takes effect. It
replaces the current plan only if it is safe until its end by the newest data; else the current
plan, which was safe, is flown to its end. So a stop within space that was observed as free always
lies ahead (the plan of last resort of T. Schouwenaars, E. Feron, J. How, "Safe receding horizon
path planning for autonomous vehicles", Allerton 2002).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.clearance import Clearance
from volery.autonomy.planning.cost_to_go import CellCosts, CostToGo, cost_to_go
from volery.autonomy.planning.primitive_selection import PrimitiveVerdicts, judge
from volery.autonomy.planning.primitives import (
    MotionLimits,
    PrimitiveCandidates,
    PrimitivePath,
    PrimitiveState,
    at_rest,
    braking,
    fan,
)
from volery.autonomy.planning.reciprocal_avoidance import HalfPlane, violation
from volery.autonomy.planning.surface import Surface
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm

_DIRECTIONS = np.arange(-math.pi, math.pi, math.pi / 20.0)
_SPEEDS = np.array([1.0, 0.7, 0.4, 0.15])
"""Fractions of the max speed."""
_OFFSETS = np.array([0.0, 0.75, -0.75])
"""Heights over the flight surface, relative to the wanted one, m."""
_AHEAD_RAD = math.radians(60.0)
"""Max angle between heading and velocity above `_ASIDE_M_S`."""
_ASIDE_M_S = 0.8
_PEAK = 1.25
"""Factor by which the acceleration may exceed the limit if the present state leaves no choice."""
_KEEP_APART = 8.0
"""Cost of each m/s outside of the velocities that keep vehicles apart."""
_KEEP_RIGHT = 1.0
"""Cost of each m/s to the left if the cheapest primitive comes too near to another vehicle."""
_LEVEL_COST, _TURN_COST = 0.4, 0.25
"""Cost of each m over or under the wanted height; of each m/s of velocity change."""
_LOST_M = 1.0
"""Distance from the plan beyond which planning restarts from the vehicle's state."""
_HARD = 1.7
"""Factor of the acceleration limit in emergency braking; the F450 can (modelling choice)."""
_MATTER = 0.05
"""Min improvement of the cost that justifies moving."""


class PlannerState(StrEnum):
    """State of the planner."""

    HOLDING = "holding"
    FLYING = "flying"
    TURNING = "turning"
    BLOCKED = "blocked"


@dataclass(frozen=True)
class PlannerSettings:
    """Safety margins and costs of plans."""

    limits: MotionLimits
    radius_m: float = 0.6
    """Min distance to obstacles at rest."""
    radius_s: float = 0.1
    """Additional distance for each m/s."""
    soft_m: float = 1.6
    """Distance up to which obstacles add cost."""
    near: float = 3.0
    """Cost of closeness to obstacles, for each metre."""
    avoid_unknown: bool = True
    """Whether plans avoid unknown space."""
    unknown_cost: float = 0.6
    """Cost of a metre of unknown space in the guidance, which may lead through it."""


class Observations(NamedTuple):
    """Observations at the time of planning."""

    clearance: Clearance
    surface: Surface
    planes: list[HalfPlane]


class RecedingHorizonPlanner(SavedAttributes):
    """Holds the current plan and computes the next one."""

    STATE = ("doing", "_path", "_began_ns", "yaw", "min_clearance_m")

    def __init__(self, policy: PlannerSettings) -> None:
        self.policy = policy
        self.doing = PlannerState.HOLDING
        self._path: PrimitivePath | None = None
        self._began_ns = 0
        self.yaw = 0.0
        """Wanted heading, rad."""
        self.min_clearance_m = math.inf
        """Min distance to obstacles along the current plan, m."""

    def state_at(self, time_ns: int) -> PrimitiveState | None:
        """Returns the planned motion; None before the first plan."""
        if self._path is None:
            return None
        return self._path.at((time_ns - self._began_ns) / NS_PER_S)

    def start(
        self, present: PrimitiveState, yaw: float, now_ns: int, then_ns: int
    ) -> PrimitiveState:
        """Returns the motion to plan from: that of the current plan at `then_ns`.

        If the vehicle is far from its plan, planning restarts from the present motion.
        """
        planned = self.state_at(now_ns)
        if planned is None or norm(planned.position - present.position) > _LOST_M:
            steady = PrimitiveState(present.position, present.velocity, np.zeros(3))
            self._path, self._began_ns = braking(steady, self.policy.limits), now_ns
            self.yaw = yaw
        state = self.state_at(then_ns)
        assert state is not None
        return state

    def forget(self) -> None:
        """Drops the plan while another source controls the vehicle."""
        self._path, self.doing = None, PlannerState.HOLDING

    def hold(self, start: PrimitiveState, then_ns: int) -> PrimitivePath:
        """Returns and commits the shortest stop."""
        self.doing = PlannerState.HOLDING
        moves = norm(start.velocity) > 0.05
        return self._commit(
            braking(start, self.policy.limits) if moves else at_rest(start.position), then_ns
        )

    def plan(
        self, start: PrimitiveState, goal: Array, sight: Observations, then_ns: int
    ) -> PrimitivePath:
        """Returns and commits the plan from `start` at `then_ns` towards `goal` (2,) m."""
        policy, surface = self.policy, sight.surface
        prices = CellCosts(policy.radius_m, policy.soft_m, policy.near, unknown=policy.unknown_cost)
        costs = cost_to_go(sight.clearance, surface, _OFFSETS, goal, prices)
        candidates = self._fan(start, surface)
        verdicts = judge(candidates, sight.clearance, costs, policy.soft_m, policy.near)
        safe = self._safe(start, candidates, verdicts, sight.clearance)
        total = self._total(start, candidates, verdicts, sight.planes)
        self._turn_nose(start, goal, costs)
        if not safe.any():
            return self._last_resort(start, sight, then_ns)
        best = int(np.argmin(np.where(safe, total, np.inf)))
        if not np.isfinite(total[best]):
            best = int(np.flatnonzero(safe)[-1])  # the last candidate stays, if that is safe
        moves = bool(np.hypot(*candidates.velocity[best, :2]) > 0.0)
        self.doing = PlannerState.FLYING if moves else PlannerState.TURNING
        stays = len(safe) - 1
        if not moves and best == stays and not np.isfinite(costs.at(start.position[:2])):
            self.doing = PlannerState.BLOCKED
        self.min_clearance_m = float(verdicts.nearest_m[best])
        return self._commit(candidates.path(best), then_ns)

    # ------------------------------------------------------------------------------------ parts

    def _commit(self, path: PrimitivePath, then_ns: int) -> PrimitivePath:
        self._path, self._began_ns = path, then_ns
        return path

    def _fan(self, start: PrimitiveState, surface: Surface) -> PrimitiveCandidates:
        limits = self.policy.limits
        d, s, o = np.meshgrid(_DIRECTIONS, limits.speed * _SPEEDS, _OFFSETS, indexing="ij")
        offset = 0.5 * limits.horizon_s * (s[..., None] * np.stack([np.cos(d), np.sin(d)], axis=-1))
        end = start.position[:2] + offset + 0.5 * limits.horizon_s * start.velocity[:2]
        wanted = surface.height_at(end) + o
        rises = (wanted - start.position[2]) / limits.horizon_s
        found = fan(start, _DIRECTIONS, limits.speed * _SPEEDS, _OFFSETS, rises, limits)
        # The last candidate holds its horizontal position and goes to the wanted height.
        rise = float(surface.height_at(start.position[:2]) - start.position[2])
        found.velocity[-1, 2] = float(np.clip(rise, -limits.climb, limits.climb))
        found.cruise_s[-1] = 0.0 if abs(rise) < 0.1 else 0.3
        return found

    def _safe(
        self,
        start: PrimitiveState,
        candidates: PrimitiveCandidates,
        verdicts: PrimitiveVerdicts,
        clearance: Clearance,
    ) -> NDArray[np.bool_]:
        """Returns the candidates within limits, in known space, not too near to obstacles."""
        policy = self.policy
        speed = np.hypot(candidates.velocity[:, 0], candidates.velocity[:, 1])
        wanted = policy.radius_m + policy.radius_s * speed
        here = float(clearance.at(start.position[None])[0])
        safe = verdicts.nearest_m >= np.minimum(wanted, here)
        safe &= verdicts.max_acceleration_m_s2 <= _PEAK * policy.limits.acceleration
        if policy.avoid_unknown:
            safe &= ~verdicts.unknown
        return safe

    def _total(
        self,
        start: PrimitiveState,
        candidates: PrimitiveCandidates,
        verdicts: PrimitiveVerdicts,
        planes: list[HalfPlane],
    ) -> Array:
        velocity = candidates.velocity
        change = np.hypot(*(velocity[:, :2] - start.velocity[:2]).T)
        total = verdicts.cost + _LEVEL_COST * np.abs(candidates.offset) + _TURN_COST * change
        total[:-1] += _MATTER
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        aside = np.arctan2(velocity[:, 1], velocity[:, 0]) - self.yaw
        aside = np.abs((aside + math.pi) % (2.0 * math.pi) - math.pi)
        total[(aside > _AHEAD_RAD) & (speed > _ASIDE_M_S)] = np.inf
        if planes:
            total = self._apart(total, velocity[:, :2], planes)
        return np.asarray(total)

    @staticmethod
    def _apart(total: Array, velocity: Array, planes: list[HalfPlane]) -> Array:
        """Adds cost near other vehicles and, if the cheapest comes too near, to the left of it.

        Without a common side to prefer, vehicles that meet head-on could stop each other.
        """
        crowded = violation(planes, velocity)
        cheapest = int(np.argmin(total))
        total = total + _KEEP_APART * crowded
        if crowded[cheapest] > 0.0:
            x, y = velocity[cheapest] / max(float(np.hypot(*velocity[cheapest])), 0.1)
            total = total + _KEEP_RIGHT * np.maximum(velocity @ np.array([-y, x]), 0.0)
        return np.asarray(total)

    def _last_resort(
        self, start: PrimitiveState, sight: Observations, then_ns: int
    ) -> PrimitivePath:
        """Flies the current plan to its end if it is still clear; else brakes, hard if needed."""
        assert self._path is not None
        self.doing = PlannerState.BLOCKED
        limits, radius = self.policy.limits, self.policy.radius_m
        hard = limits._replace(acceleration=_HARD * limits.acceleration)
        since = (then_ns - self._began_ns) / NS_PER_S
        candidates = [
            (self._path, self._began_ns, since),
            (braking(start, limits), then_ns, 0.0),
            (braking(start, hard), then_ns, 0.0),
        ]
        clearances = [
            _min_clearance(path, begin_s, sight.clearance) for path, _, begin_s in candidates
        ]
        enough = [distance >= radius for distance in clearances]
        best = enough.index(True) if any(enough) else int(np.argmax(clearances))
        self.min_clearance_m = clearances[best]
        path, self._began_ns, _ = candidates[best]
        self._path = path
        return path

    def _turn_nose(self, start: PrimitiveState, goal: Array, costs: CostToGo) -> None:
        """Turns the heading towards the flight direction, or the wanted one."""
        if float(np.hypot(*start.velocity[:2])) > 0.7:
            self.yaw = math.atan2(start.velocity[1], start.velocity[0])
            descent = costs.descent(start.position[:2])
            if descent is not None:
                off = math.remainder(descent - self.yaw, 2.0 * math.pi)
                self.yaw += 0.5 * max(-0.8, min(0.8, off))
            return
        descent = costs.descent(start.position[:2])
        if descent is not None:
            self.yaw = descent
            return
        to_goal = goal - start.position[:2]
        if float(np.hypot(*to_goal)) > 0.5:
            self.yaw = math.atan2(to_goal[1], to_goal[0])

    @property
    def began_ns(self) -> int:
        """Returns the start time of the current plan, ns."""
        return self._began_ns


def _min_clearance(path: PrimitivePath, begin_s: float, clearance: Clearance) -> float:
    """Returns the min distance (m) to obstacles from `begin_s` to the end of a path."""
    times = np.append(np.arange(begin_s, path.duration_s, 0.1), max(path.duration_s, begin_s))
    return float(clearance.at(np.array([path.at(t).position for t in times])).min())
