"""Flies one UAV of a team that forms a V without a leader: each plans for itself.

The UAVs know of each other by reports over the radio alone. Birds move in common steps of the
clock; within a step each UAV plans its bird's next velocity in its own slot and announces it, so
that those in later slots plan with it. Birds, steps and lengths are those of `v_formation`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.status import publish_status
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.formation_fitness import formation_fitness
from volery.autonomy.swarm.member_planning import MemberPlanner
from volery.autonomy.swarm.orca import Orca, OrcaSettings
from volery.autonomy.swarm.particle_swarm import vehicle_limits
from volery.autonomy.swarm.random_start import random_start
from volery.autonomy.swarm.team_link import TeamLink, limited, number
from volery.autonomy.swarm.v_formation import (
    GAIN,
    GATHER_APART,
    LOST_COST,
    MAX_OFFSET,
    MIN_DISTANCE,
    NEAR_M,
    OVERSPEED,
    WING_SPAN_M,
)
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import PlanError
from volery.core.saved_state import SavedAttributes
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Point, String, Vector3, header, message_type, stamp_of
from volery.graph.nodes.node import Node

REPORT = "volery_interfaces/msg/TeamReport"
_PERIOD_S, _REPORT_S = 0.05, 0.2
_SILENCE_S = 2.0
"""Time without reports after which a UAV counts as lost."""
_BLOCKED_S = 10.0
"""Time without progress after which a UAV waits where it is, not at its start position."""
_WAIT_S = 60.0
"""Time at the start position after which a UAV no longer waits for those that it does not hear."""
_SLOTS = 0.8
"""Part of a step in which all plan."""
_SENSIBLE_M = 1e6
_MAP = "map"


class MemberPhase(StrEnum):
    """What a UAV does; a team report contains it."""

    WAIT = "wait"
    """Takes off, or waits for odometry."""
    GATHER = "gather"
    """Flies to its start position."""
    READY = "ready"
    """Hovers there until the others are ready."""
    SEARCH = "search"
    """Flies in the formation, and looks for a better position nearby."""
    JOIN = "join"
    """Flies to an end of the formation."""
    LOST = "lost"
    """Has no odometry, or is low, and commands nothing."""


_FLYING = (MemberPhase.SEARCH, MemberPhase.JOIN)
_MOVING = {MemberPhase.READY, *_FLYING}
_GATHERING = {MemberPhase.GATHER, MemberPhase.READY}


class _Mate(NamedTuple):
    """Another UAV's last report."""

    phase: MemberPhase
    begins_ns: int
    """Time at which the bird is at the position, ns."""
    position: Array
    """(2,) m, map."""
    velocity: Array
    """(2,) m/s, from then on."""
    heard_ns: int


class FormationMember(SavedAttributes, Node):
    """Flies the UAV of its namespace into a V with those that it hears on `radio/team`.

    Publishes reports on `team`, for the radio, and `~/status` (JSON) after each step. All members
    must have equal parameters. UAVs that do not start with a take-off are waited for.

    Parameters
    ----------
    uavs: names of the team. They wait for each other before they set off, a minute for those that
        they do not hear; later the team consists of those that are heard.
    odometry: topic of the odometry; its frame must be fixed to the map, the same for all.
    wing_span_m, step_s, height_m, height_step_m, min_distance, max_speed_m_s,
        max_acceleration_m_s2: as in `v_formation`.
    neighbours: number of UAVs in a neighbourhood, whose fitness a UAV optimizes; itself included.
    start_m: middle [x, y] of random start positions, m in the map; empty: the UAVs set off from
        where they are.
    seed: of starts and searches.

    """

    STATE = (
        *("phase", "_anchor", "_anchor_ns", "_velocity", "_next", "_step", "_mates"),
        *("_ready_ns", "_reported_ns", "_solved_ns", "_last_status"),
    )
    PARTS = ("_link", "_planner")
    WARMUP_TASKS = (
        "volery.autonomy.swarm.warmup:member_planning",
        "volery.autonomy.swarm.warmup:flocking",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("formation_member", **options)
        self._own_name = self.get_namespace().strip("/")
        self._names = [str(n) for n in self.declare_parameter("uavs", [self._own_name]).value]
        if self._own_name not in self._names or len(set(self._names)) < len(self._names):
            raise PlanError("parameter uavs must name this UAV and the others, each once")
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._span = number(self, "wing_span_m", WING_SPAN_M, 0.1, 100.0)
        self._step_s = number(self, "step_s", 2.0, 0.5, 100.0)
        height = number(self, "height_m", 5.0, 0.5, 1000.0)
        height_step = number(self, "height_step_m", 0.0, 0.0, 100.0)
        distance = number(self, "min_distance", MIN_DISTANCE, 0.0, 1.5)
        self._max_speed = number(self, "max_speed_m_s", 4.0, 0.1, 100.0)
        acceleration = number(self, "max_acceleration_m_s2", 1.0, 0.01, 100.0)
        neighbours = self.declare_parameter("neighbours", 7, min_value=2, max_value=100).value
        middle = list(self.declare_parameter("start_m", []).value)
        seed = int(self.declare_parameter("seed", 1, min_value=0).value)
        if len(middle) not in (0, 2) or not np.isfinite(middle).all():
            raise PlanError("parameter start_m must be [x, y] or empty")

        names, start = sorted(self._names), random_start(len(self._names), seed)
        row = names.index(self._own_name)
        self._starts = _starts_around(middle, names, self._span * start.positions)
        """(2,) m, map: where each UAV waits for the others; empty: where it has taken off."""
        self._start = self._starts.get(self._own_name)
        self._first_velocity = start.velocities[row] * self._span / self._step_s
        self._height = height + height_step * (row % 2)
        self._slot_ns = ns_from_s(_SLOTS * self._step_s * row / len(self._names))
        limits = vehicle_limits(distance, self._max_speed, acceleration, self._span, self._step_s)
        self._planner = MemberPlanner(limits, neighbours=int(neighbours), seed=seed + row)
        self._avoidance = Orca(
            OrcaSettings(distance_m=GATHER_APART * self._span, max_speed_m_s=self._max_speed)
        )

        self.phase = MemberPhase.WAIT
        self._anchor = np.zeros(2)
        """(2,) m, map: position of the bird at `_anchor_ns`, from which it flies straight."""
        self._anchor_ns = 0
        self._velocity = np.zeros(2)
        """(2,) m/s, map: velocity of the bird in the present step."""
        self._next: Array | None = None
        """(2,) m/s: velocity that is announced for the next step; None: not planned yet."""
        self._step = -1
        """Number of the present step since the beginning of the clock."""
        self._mates: dict[str, _Mate] = {}
        self._progress = math.inf, 0
        """Least distance from the start position so far, m, and the time of that, ns."""
        self._ready_ns = 0
        """Time at which the UAV was at its start position, ns."""
        self._reported_ns, self._solved_ns, self._last_status = -NS_PER_S, -1, ""

        self._link = TeamLink(self, [self._own_name], odometry, height)
        self._reports = self.create_publisher(message_type(REPORT), "team", 5)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self.create_subscription(message_type(REPORT), "radio/team", self._on_report, 50)
        self.create_timer(_PERIOD_S, self._on_timer)

    # -------------------------------------------------------------------------------- reports

    def _on_report(self, report: Any) -> None:
        p, v, now_ns = report.position, report.velocity, self.get_clock().now_ns()
        numbers, begins_ns = np.array([p.x, p.y, v.x, v.y]), stamp_of(report)
        if report.name not in self._names or report.name == self._own_name:
            return
        if report.phase not in tuple(MemberPhase) or not np.abs(numbers).max() < _SENSIBLE_M:
            return
        if abs(begins_ns - now_ns) > ns_from_s(_SILENCE_S + 2.0 * self._step_s):
            return
        known = self._mates.get(report.name)
        if known is None or begins_ns >= known.begins_ns:
            phase = MemberPhase(report.phase)
            self._mates[report.name] = _Mate(phase, begins_ns, numbers[:2], numbers[2:], now_ns)

    def _report(self, now_ns: int) -> None:
        """Reports the motion of the bird in the next step, where it is planned, or in this one."""
        self._reported_ns = now_ns
        begins_ns, position, velocity = self._announced()
        message = zero_message(REPORT)
        message.header = header(begins_ns, _MAP)
        message.name, message.phase, message.battery = self._own_name, str(self.phase), math.nan
        (x, y), (vx, vy) = position.tolist(), velocity.tolist()
        message.position, message.velocity = Point(x, y, self._height), Vector3(vx, vy, 0.0)
        self._reports.publish(message)

    def _announced(self) -> tuple[int, Array, Array]:
        if self._next is None or self.phase not in _FLYING:
            return self._anchor_ns, self._anchor, self._velocity
        begins_ns = self._begin_of(self._step + 1)
        return begins_ns, self._bird_at(begins_ns), self._next

    # ------------------------------------------------------------------------------ behaviour

    def _on_timer(self) -> None:
        now_ns = self.get_clock().now_ns()
        self._mates = {
            name: mate
            for name, mate in self._mates.items()
            if now_ns - mate.heard_ns < ns_from_s(_SILENCE_S)
        }
        if self.phase is MemberPhase.WAIT:
            if not self._link.is_up():
                return
            self._begin()
        elif self._link.drop_lost(now_ns):
            self.phase = MemberPhase.LOST
            self._publish_status()
        if self.phase is MemberPhase.LOST:
            return
        self._advance(now_ns)
        if now_ns - self._reported_ns >= ns_from_s(_REPORT_S):
            self._report(now_ns)

    def _begin(self) -> None:
        position, _ = self._link.motion()
        self._start = position[0] if self._start is None else self._start
        self.phase = MemberPhase.GATHER

    def _advance(self, now_ns: int) -> None:
        position, velocity = (rows[0] for rows in self._link.motion())
        if self.phase is MemberPhase.GATHER:
            assert self._start is not None
            self._anchor, self._anchor_ns, self._velocity = position, now_ns, velocity
            self._step = now_ns // self._step_ns
            self._start = self._reachable_start(now_ns, position)
            if np.abs(position - self._start).max() < NEAR_M:
                self.phase, self._ready_ns = MemberPhase.READY, now_ns
                self._anchor, self._velocity = self._start, self._first_velocity
                self._publish_status()
        elif self.phase is MemberPhase.READY:
            assert self._start is not None
            self._anchor_ns = now_ns
            step = now_ns // self._step_ns
            if np.abs(position - self._start).max() > NEAR_M:
                self.phase = MemberPhase.GATHER  # it has made way for others
                self._progress = math.inf, now_ns
            elif step != self._step and self._is_team_ready(now_ns):
                self._set_off(now_ns)
            self._step = step
        else:
            self._fly(now_ns, position)
        self._steer(now_ns, position, velocity)

    def _reachable_start(self, now_ns: int, position: Array) -> Array:
        """Returns the start position (2,) m, or the present one if others block the way there."""
        assert self._start is not None
        distance = math.dist(self._start, position)
        least, since_ns = self._progress
        if distance < least - NEAR_M:
            self._progress = distance, now_ns
        elif now_ns - since_ns > ns_from_s(_BLOCKED_S):
            return position.copy()
        return self._start

    def _is_team_ready(self, now_ns: int) -> bool:
        """Returns whether all wait at their starts, or one of them has set off."""
        phases = [mate.phase for mate in self._mates.values()]
        if any(phase in _FLYING for phase in phases):
            return True
        has_waited = bool(phases) and now_ns - self._ready_ns > ns_from_s(_WAIT_S)
        is_complete = has_waited or len(phases) == len(self._names) - 1
        return is_complete and all(phase is MemberPhase.READY for phase in phases)

    def _set_off(self, now_ns: int) -> None:
        """Leaves the start; the foremost UAVs search a formation that the others join."""
        flock, _, me = self._known_flock(now_ns)
        self._planner.begin(flock, me)
        self._change_phase()
        self._anchor_ns = now_ns

    def _fly(self, now_ns: int, position: Array) -> None:
        """Moves the bird on, and plans its next velocity in the UAV's own slot."""
        if now_ns // self._step_ns != self._step:
            self._anchor, self._anchor_ns = self._bird_at(now_ns), now_ns
            if self._next is not None:
                self._velocity, self._next = self._next, None
            self._step = now_ns // self._step_ns
            self._publish_status()
        if np.abs(position - self._bird_at(now_ns)).max() > MAX_OFFSET * self._span:
            self._anchor, self._anchor_ns = position, now_ns  # the UAV was displaced
        if self._next is None and now_ns - self._begin_of(self._step) >= self._slot_ns:
            flock, joining, me = self._known_flock(self._begin_of(self._step + 1))
            planned = self._planner.velocity(flock, joining, me)
            self._next = planned * self._span / self._step_s
            self._change_phase()
            self._report(now_ns)

    def _change_phase(self) -> None:
        self.phase = MemberPhase.JOIN if self._planner.is_joining else MemberPhase.SEARCH

    def _steer(self, now_ns: int, position: Array, velocity: Array) -> None:
        """Commands the UAV towards its bird."""
        if self.phase in _GATHERING:
            level = self._towards_start(position, velocity)
        else:
            level = self._velocity + GAIN * (self._bird_at(now_ns) - position)
        self._link.command(0, limited(level, OVERSPEED * self._max_speed), self._height)

    def _towards_start(self, position: Array, velocity: Array) -> Array:
        """Returns the velocity (2,) m/s to the start position, past the others.

        All know the starts of all, so that those that have arrived make way for the others.
        """
        assert self._start is not None
        at, moving, starts = [position], [velocity], [self._start]
        for name, mate in self._mates.items():
            motion = np.zeros(2) if mate.phase is MemberPhase.READY else mate.velocity
            goal = mate.position + motion / GAIN
            at.append(mate.position)
            moving.append(motion)
            is_on_its_way = mate.phase is MemberPhase.GATHER
            starts.append(self._starts.get(name, goal) if is_on_its_way else goal)
        wanted = GAIN * (np.array(starts) - np.array(at))
        flock = flock_within(np.array(at), np.array(moving), self._avoidance.radius_m)
        return np.asarray(self._avoidance.velocities(flock, wanted, Surroundings())[0])

    # --------------------------------------------------------------------------------- inside

    @property
    def _step_ns(self) -> int:
        return ns_from_s(self._step_s)

    def _begin_of(self, step: int) -> int:
        return step * self._step_ns

    def _bird_at(self, time_ns: int) -> Array:
        """Returns the bird's position (2,) m, on its straight path."""
        return np.asarray(self._anchor + self._velocity * ((time_ns - self._anchor_ns) / NS_PER_S))

    def _known_flock(self, time_ns: int) -> tuple[Array, NDArray[np.bool_], int]:
        """Returns the flock (4, N) at a time, by name, which of it joins (N,), and the own row.

        In wing spans and steps. Those on the way to their start are left out.
        """
        birds = {self._own_name: (self._bird_at(time_ns), self._velocity, self.phase)}
        if self.phase is MemberPhase.READY:
            birds[self._own_name] = (self._anchor, self._velocity, self.phase)
        for name, mate in self._mates.items():
            if mate.phase in _MOVING:
                flies = mate.phase in _FLYING
                after_s = (time_ns - mate.begins_ns) / NS_PER_S if flies else 0.0
                birds[name] = (mate.position + after_s * mate.velocity, mate.velocity, mate.phase)
        names = sorted(birds)
        position = np.array([birds[name][0] for name in names]) / self._span
        velocity = np.array([birds[name][1] for name in names]) * self._step_s / self._span
        joining = np.array([birds[name][2] is MemberPhase.JOIN for name in names])
        flock = np.ascontiguousarray(np.hstack((position, velocity)).T)
        return flock, joining, names.index(self._own_name)

    def _publish_status(self) -> None:
        now_ns = self.get_clock().now_ns()
        flock, _, _ = self._known_flock(now_ns)
        fitness = formation_fitness(flock[:2].T, flock[2:].T)
        is_flying = self.phase in _FLYING
        if is_flying and self._solved_ns < 0 and fitness.cost < LOST_COST:
            self._solved_ns = now_ns
        status = {
            "phase": str(self.phase),
            "members": sorted([self._own_name, *self._mates]),
            **{name: round(part, 6) for name, part in fitness._asdict().items()},
            "time_to_v_s": None if self._solved_ns < 0 else self._solved_ns / NS_PER_S,
        }
        self._last_status = publish_status(self._status, status, self._last_status)


def _starts_around(
    middle: Sequence[float], names: Sequence[str], offsets: Array
) -> dict[str, Array]:
    """Returns the start positions (2,) m of all UAVs by name; empty without a middle."""
    return dict(zip(names, np.array(middle) + offsets, strict=True)) if middle else {}
