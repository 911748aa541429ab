"""Flies a team into a V and keeps it in one: ARES plans while the team flies.

Each UAV follows a bird, a point that moves as the plan says. A bird's wing span is a length, its
step a time; its upwash measures the formation and acts on no multirotor.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Any

import numpy as np

from volery.autonomy.status import publish_status
from volery.autonomy.swarm.ares import AresPlan, AresSettings
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.formation_fitness import FormationFitness, formation_fitness
from volery.autonomy.swarm.formation_search import FormationSearch
from volery.autonomy.swarm.hostile_uavs import HostileUavs
from volery.autonomy.swarm.orca import Orca, OrcaSettings
from volery.autonomy.swarm.particle_swarm import approach_margin, vehicle_limits
from volery.autonomy.swarm.random_start import random_start
from volery.autonomy.swarm.team_link import TeamLink, limited, number
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import String
from volery.graph.nodes.node import Node

WING_SPAN_M = 3.0
"""Default of the parameter `wing_span_m`."""
MIN_DISTANCE = 1.0
"""Default of the parameter `min_distance`, wing spans."""
LOST_COST = 0.1
"""Default of the parameter `lost_cost`."""
_PERIOD_S = 0.05
GAIN = 0.8
"""Velocity per distance from the bird, 1/s."""
OVERSPEED = 1.5
"""Limit of commanded speeds, in speeds of a plan: UAVs catch up with their birds."""
NEAR_M = 0.4
"""Distance at which a UAV has arrived at its start position."""
MAX_OFFSET = 1.5
"""Distance from its bird, in wing spans, at which a UAV counts as displaced."""
GATHER_APART = 0.7
"""Distance that UAVs keep on their paths to the start positions, in wing spans."""
_SEVEN = 7
_DRAWS = 1_000
_SLOWEST = 0.25
"""Speed of a bird that plans from a flight without a formation, wing spans per step."""
_MAX_LEAD = 8
"""Maximum steps that a search may last."""
_MAX_KICKS = 10
"""Random changes of the velocities after searches in vain, until the best plan is flown."""


class VFormationPhase(StrEnum):
    """What the team does."""

    ASCEND = "ascend"
    """Takes off, or waits for all odometry."""
    GATHER = "gather"
    """Flies to the drawn start positions."""
    SEARCH = "search"
    """Flies straight on while a plan is searched."""
    REFORM = "reform"
    """Follows a plan."""
    CRUISE = "cruise"
    """Flies on after a plan."""
    FLEE = "flee"
    """Flees from a hostile UAV, without a formation."""


class VFormation(SavedAttributes, Node):
    """Flies the team `uavs` into a V. Publishes `~/status` (JSON) after each step of the birds.

    The team gathers at random positions with random velocities, like the starts of ARES, and
    searches a plan from there, a slice each 50 ms. It searches anew when a UAV leaves the team, is
    displaced, or the formation is lost. UAVs that do not start with a take-off are waited for.

    Parameters
    ----------
    uavs: names of the team.
    odometry: topic of the odometry, below a UAV's namespace; its frame must be fixed to the map.
    wing_span_m: wing span of a bird; the UAVs of a V are 1.9 of them apart sideways, 1 ahead.
    step_s: duration of a bird's step.
    height_m: height of the formation, m in the map.
    height_step_m: height by which every second UAV flies above the others.
    min_distance: distance that plans keep between birds, in wing spans.
    max_speed_m_s: speed that plans do not exceed.
    max_acceleration_m_s2: change of a bird's velocity that plans do not exceed, over its step.
    slices: steps of the search in each period of 50 ms.
    lost_cost: cost of the formation above which a V is lost.
    seed: of starts and searches.
    gathers: whether the team first flies to random positions.
    hostile, hostile_m, flee_m_s: as in `flock`; the team forms a V anew when they are far.

    """

    STATE = (
        *("phase", "_bird", "_velocity", "_search", "_plan", "_step"),
        *("_step_ns", "_lost_steps", "_num_searches", "_num_kicks", "_lead"),
        *("_last_status", "_note", "_solved_ns"),
    )

    PARTS = ("_team", "_hostile")
    WARMUP_TASKS = (
        "volery.autonomy.swarm.warmup:formation_search",
        "volery.autonomy.swarm.warmup:flocking",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("v_formation", **options)
        named = self.declare_parameter("uavs", [f"uav{k + 1}" for k in range(_SEVEN)]).value
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._span = number(self, "wing_span_m", WING_SPAN_M, 0.1, 100.0)
        self._duration_s = number(self, "step_s", 2.0, 0.1, 100.0)
        self._height = number(self, "height_m", 5.0, 0.5, 1000.0)
        self._hostile = HostileUavs(self, odometry, self._height)
        names = [name for name in named if name not in self._hostile.names]
        self._height_step = number(self, "height_step_m", 0.0, 0.0, 100.0)
        distance = number(self, "min_distance", MIN_DISTANCE, 0.0, 1.5)
        self._slices = int(self.declare_parameter("slices", 10, min_value=1, max_value=1000).value)
        self._lost_cost = number(self, "lost_cost", LOST_COST, 1e-3, 1e3)
        self._seed = int(self.declare_parameter("seed", 1, min_value=0).value)
        self._gathers = bool(self.declare_parameter("gathers", True).value)
        self._max_speed = max_speed = number(self, "max_speed_m_s", 4.0, 0.1, 100.0)
        acceleration = number(self, "max_acceleration_m_s2", 1.0, 0.01, 100.0)
        limits = vehicle_limits(distance, max_speed, acceleration, self._span, self._duration_s)
        self._settings = AresSettings(limits=limits)
        fastest = max(max_speed, self._hostile.speed_m_s) if self._hostile.names else max_speed
        self._avoidance = Orca(
            OrcaSettings(distance_m=GATHER_APART * self._span, max_speed_m_s=fastest)
        )

        self.phase = VFormationPhase.ASCEND
        self._bird = np.zeros((len(names), 2))
        """(N, 2) m, map: positions that the UAVs follow."""
        self._velocity = np.zeros((len(names), 2))
        """(N, 2) m/s, map: velocities of the birds."""
        self._search: FormationSearch | None = None
        self._plan: AresPlan | None = None
        self._step = 0
        self._step_ns = 0
        """Time at which the present step ends, ns."""
        self._lost_steps = 0
        self._num_searches = 0
        self._num_kicks = 0
        self._lead = 0
        """Steps that the birds fly straight before a plan begins; 0: they hover."""
        self._solved_ns = -1
        """Time of the first V, ns; -1: none so far."""
        self._note = ""
        self._last_status = ""

        self._team = TeamLink(self, names, odometry, self._height)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self.create_timer(_PERIOD_S, self._on_timer)

    # ------------------------------------------------------------------------------- behaviour

    def _on_timer(self) -> None:
        now_ns = self.get_clock().now_ns()
        if self.phase is VFormationPhase.ASCEND:
            if self._team.is_up():
                self._begin(now_ns)
            return
        self._drop_lost(now_ns)
        if not self._team.members or self._flees(now_ns):
            return
        if self.phase is VFormationPhase.GATHER:
            if self._has_gathered():
                self._set_off(now_ns)
        else:
            if not self._hovers:
                self._bird[self._team.members] += self._velocity[self._team.members] * _PERIOD_S
            if self.phase is VFormationPhase.SEARCH:
                self._continue_search(now_ns)
            if self.phase is not VFormationPhase.SEARCH and now_ns >= self._step_ns:
                self._end_step(now_ns)
        self._steer()

    def _flees(self, now_ns: int) -> bool:
        """Flies away from near hostile UAVs; returns whether there are some."""
        rows, (position, velocity) = self._team.members, self._team.motion()
        wanted = np.tile(velocity.mean(axis=0), (len(rows), 1))
        if not self._hostile.add_flight(position, wanted, now_ns):
            if self.phase is VFormationPhase.FLEE:
                self._restart_search(now_ns, "fled from a hostile UAV")
            return False
        self._bird[rows], self._velocity[rows] = position, self._of_birds(velocity)
        if self.phase is not VFormationPhase.FLEE:
            self.phase, self._search, self._plan = VFormationPhase.FLEE, None, None
            self._publish_status()
        flock = flock_within(position, velocity, self._avoidance.radius_m)
        self._command(self._avoidance.velocities(flock, wanted, Surroundings()))
        return True

    def _of_birds(self, velocity: Array) -> Array:
        """Returns velocities (M, 2) as birds may have them, which never stand still."""
        middle = velocity.mean(axis=0)
        slowest = _SLOWEST * self._span / self._duration_s
        ahead = middle / norm(middle) if norm(middle) > 1e-3 else np.array([1.0, 0.0])
        flown = [each if norm(each) > slowest else slowest * ahead for each in velocity]
        return np.array([limited(each, self._max_speed) for each in flown])

    def _begin(self, now_ns: int) -> None:
        self._bird[:] = self._team.motion()[0]
        if self._gathers:
            middle = self._bird.mean(axis=0)
            along = np.argsort(self._bird[:, 0], kind="stable")
            start = random_start(len(along), self._seed)
            self._bird[along] = middle + self._span * start.positions
            self.phase = VFormationPhase.GATHER
        else:
            self._set_off(now_ns)

    @property
    def _hovers(self) -> bool:
        return self.phase is VFormationPhase.SEARCH and self._lead == 0

    def _has_gathered(self) -> bool:
        position, _ = self._team.motion()
        return bool((np.abs(position - self._bird[self._team.members]) < NEAR_M).all())

    def _set_off(self, now_ns: int) -> None:
        """Searches the first plan, with random velocities; the UAVs hover until it is found."""
        start = random_start(len(self._velocity), self._seed)
        self._velocity[:] = start.velocities * self._span / self._duration_s
        self._num_kicks, self._lead = 0, 0
        self._begin_search(now_ns, "start")

    def _begin_search(self, now_ns: int, reason: str) -> None:
        """Searches a plan that begins `_lead` steps from now, until when the birds fly straight."""
        self._note, self.phase = reason, VFormationPhase.SEARCH
        self._plan, self._lost_steps = None, 0
        self._step_ns = now_ns + round(self._lead * self._duration_s * NS_PER_S)
        self._num_searches += 1
        flock = self._flock(self._lead)
        self._search = FormationSearch(
            flock[:2].T, flock[2:].T, self._seed + self._num_searches, self._settings
        )
        self._publish_status()

    def _flock(self, steps: int) -> Array:
        """Returns the flock (4, N) after steps straight on, in wing spans and steps."""
        velocity = self._velocity[self._team.members] * self._duration_s
        position = self._bird[self._team.members] + steps * velocity
        flock: Array = np.concatenate((position.T, velocity.T)) / self._span
        return flock

    def _restart_search(self, now_ns: int, reason: str) -> None:
        """Searches from the flight, which has changed."""
        self._num_kicks, self._lead = 0, 1
        self._begin_search(now_ns, reason)

    def _advance_search(self) -> bool:
        """Returns whether the search has ended."""
        search = self._search
        for _ in range(self._slices):
            if search is None or search.is_done:
                return True
            search.advance()
        return False

    def _continue_search(self, now_ns: int) -> None:
        has_ended, search = self._advance_search(), self._search
        if search is None or now_ns < self._step_ns:
            return
        if not has_ended:
            if self._lead:  # straight paths of unlike velocities: the plan would begin elsewhere
                self._lead = min(2 * self._lead, _MAX_LEAD)
                self._begin_search(now_ns, "the search has used up its time")
            return
        plan = search.plan()
        if not plan.is_solved and self._num_kicks < _MAX_KICKS:
            self._kick()
            self._begin_search(now_ns, f"no plan ends in a V: cost {plan.cost:.2g}")
            return
        self._plan, self._search, self._step = plan, None, 0
        self.phase = VFormationPhase.REFORM

    def _kick(self) -> None:
        """Changes all velocities at random: from elsewhere, another search finds its way."""
        self._num_kicks += 1
        rng = np.random.default_rng([self._seed, 2, self._num_searches])
        rows, steps = self._team.members, max(1, self._lead)
        min_distance = self._settings.limits.min_distance
        before, kept = self._flock(0), self._velocity[self._team.members].copy()
        for _ in range(_DRAWS):
            size = rng.uniform(0.0, 0.7, len(rows)) * np.linalg.norm(kept, axis=1)
            direction = rng.uniform(-math.pi, math.pi, len(rows))
            self._velocity[rows] = (
                kept + (size * np.array([np.cos(direction), np.sin(direction)])).T
            )
            if approach_margin(before, self._flock(steps), min_distance) >= 0.0:
                return
        self._velocity[rows] = kept

    def _end_step(self, now_ns: int) -> None:
        """Passes to the next step of the birds."""
        self._step_ns = now_ns + round(self._duration_s * NS_PER_S)
        if self.phase is VFormationPhase.REFORM and self._plan is not None:
            self._step += 1
            if self._step < len(self._plan.velocities):
                scale = self._span / self._duration_s
                self._velocity[self._team.members] = self._plan.velocities[self._step] * scale
            else:
                rows = self._team.members
                self.phase = VFormationPhase.CRUISE
                self._velocity[rows] = self._velocity[rows].mean(axis=0)
        if self.phase is VFormationPhase.CRUISE:
            self._look(now_ns)
        self._publish_status()

    def _look(self, now_ns: int) -> None:
        """Searches anew where the formation has been lost for some steps."""
        cost = self._fitness().cost
        if cost <= self._lost_cost:
            self._lost_steps = 0
            if self._solved_ns < 0:
                self._solved_ns = now_ns
            return
        self._lost_steps += 1
        if self._lost_steps > 2:
            self._restart_search(now_ns, f"the formation is lost: cost {cost:.2g}")

    def _drop_lost(self, now_ns: int) -> None:
        """Removes lost UAVs from the team; takes over the positions of displaced ones."""
        lost = ", ".join(self._team.drop_lost(now_ns))
        if self.phase is VFormationPhase.GATHER or not self._team.members:
            return
        rows = np.array(self._team.members)
        position, _ = self._team.motion()
        offset = np.abs(position - self._bird[rows]).max(axis=1)
        is_displaced = offset > MAX_OFFSET * self._span
        self._bird[rows[is_displaced]] = position[is_displaced]
        if lost or is_displaced.any():
            self._restart_search(now_ns, f"{lost} left" if lost else "a UAV was displaced")

    def _steer(self) -> None:
        """Commands the members towards their birds."""
        rows = self._team.members
        position, velocity = self._team.motion()
        is_still = self.phase is VFormationPhase.GATHER or self._hovers
        ahead = np.zeros((len(rows), 2)) if is_still else self._velocity[rows]
        wanted = ahead + GAIN * (self._bird[rows] - position)
        if self.phase is VFormationPhase.GATHER:
            flock = flock_within(position, velocity, self._avoidance.radius_m)
            wanted = self._avoidance.velocities(flock, wanted, Surroundings())
        self._command(wanted)

    def _command(self, wanted: Array) -> None:
        """Commands the members velocities (M, 2) m/s."""
        for row, level in zip(self._team.members, wanted, strict=True):
            height = self._height + self._height_step * (row % 2)
            self._team.command(row, limited(level, OVERSPEED * self._max_speed), height)

    # ---------------------------------------------------------------------------------- status

    def _fitness(self) -> FormationFitness:
        """Returns the fitness of the measured formation."""
        position, velocity = self._team.motion()
        return formation_fitness(position / self._span, velocity * self._duration_s / self._span)

    def _publish_status(self) -> None:
        fitness = self._fitness()
        status = {
            "phase": str(self.phase),
            "members": [self._team.names[row] for row in self._team.members],
            **{name: round(part, 6) for name, part in fitness._asdict().items()},
            "searches": self._num_searches,
            "reason": self._note,
            "time_to_v_s": None if self._solved_ns < 0 else self._solved_ns / NS_PER_S,
            "refused": self._team.num_refused,
        }
        self._last_status = publish_status(self._status, status, self._last_status)
