"""Flies a team by a swarm behaviour: to common waypoints, or each UAV to its own goal."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from volery.autonomy.perception.list_parameters import declare_points
from volery.autonomy.status import publish_status
from volery.autonomy.swarm.behaviour import (
    NO_ARENA,
    Surroundings,
    SwarmBehaviour,
    flock_within,
)
from volery.autonomy.swarm.hostile_uavs import HostileUavs
from volery.autonomy.swarm.olfati_saber import OlfatiSaber
from volery.autonomy.swarm.orca import Orca
from volery.autonomy.swarm.team_link import TeamLink, number
from volery.autonomy.swarm.team_scans import TeamScans
from volery.autonomy.swarm.trajectories import Trajectories
from volery.autonomy.swarm.vasarhelyi import Vasarhelyi
from volery.core.arrays import Array
from volery.core.errors import PlanError
from volery.core.saved_state import SavedAttributes, Stateful
from volery.graph.messages import String
from volery.graph.nodes.node import Node

_PERIOD_S = 0.05
_STATUS_PERIODS = 20
_APPROACH = 0.8
"""Speed per distance from a goal, 1/s."""


class FlockNode(SavedAttributes, Node):
    """Flies the team `uavs` by a behaviour. Publishes `~/status` (JSON) each second.

    UAVs that do not start with a take-off are waited for. A behaviour of your own flies in a
    subclass, whose `BEHAVIOURS` name it: what a scenario may run is decided by its nodes.

    Parameters
    ----------
    uavs: names of the team.
    behaviour: one of `BEHAVIOURS`; by default the first.
    odometry: topic of the odometry, below a UAV's namespace; its frame must be fixed to the map.
    height_m: height of the flight, m in the map.
    speed_m_s: speed towards waypoints and goals.
    waypoints_m: x, y of points to which the whole team flies in turn, m in the map.
    swaps: whether each UAV flies to the point opposite to its start, seen from the team's middle.
    goals_m: x, y of a goal for each UAV, instead of waypoints.
    arrival_m: distance of the team's middle, or of a UAV, at which a waypoint counts as reached.
    arena_m: x_min, y_min, x_max, y_max of the walls; empty: there are none.
    obstacles_m: x, y, radius of obstacles.
    scan: topic of a planar LIDAR, below a UAV's namespace, whose echoes are obstacles as well.
    lidar_mount: x, y, z of that LIDAR in the body, m.
    hostile: names of UAVs that the team flees; they are no part of it, even where `uavs` has them.
    hostile_m: distance from a hostile UAV at which a UAV begins to flee.
    flee_m_s: speed at which it flees at half that distance and nearer.

    """

    BEHAVIOURS: ClassVar[dict[str, type[Any]]] = {
        "vasarhelyi": Vasarhelyi,
        "olfati_saber": OlfatiSaber,
        "orca": Orca,
        "trajectories": Trajectories,
    }
    """Implementations of `SwarmBehaviour` by the names of the parameter `behaviour`."""

    STATE = ("_goals", "_next", "_last_status", "_ticks")
    PARTS = ("_team", "_hostile", "_scans")
    WARMUP_TASKS = ("volery.autonomy.swarm.warmup:flocking",)

    def __init__(self, **options: Any) -> None:
        super().__init__("flock", **options)
        named = self.declare_parameter("uavs", ["uav1", "uav2", "uav3"]).value
        self._behaviour = self._named_behaviour()
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._height = number(self, "height_m", 5.0, 0.5, 1000.0)
        self._hostile = HostileUavs(self, odometry, self._height)
        names = [name for name in named if name not in self._hostile.names]
        self._speed = number(self, "speed_m_s", 3.0, 0.0, 100.0)
        self._waypoints = self._rows("waypoints_m", [[0.0, 0.0]], 2)
        if not len(self._waypoints):
            raise PlanError("waypoints_m is empty")
        self._swaps = bool(self.declare_parameter("swaps", False).value)
        own_goals = declare_points(self, "goals_m", [])
        if own_goals and len(own_goals) != len(names):
            raise PlanError("goals_m has one goal for each UAV")
        self._own_goals = np.array(own_goals, float).reshape(-1, 2)
        self._arrival = number(self, "arrival_m", 3.0, 0.1, 1000.0)
        arena = self.declare_parameter("arena_m", []).value or NO_ARENA
        if len(arena) != len(NO_ARENA):
            raise PlanError("arena_m is [x_min, y_min, x_max, y_max]")
        obstacles = self._rows("obstacles_m", [], 3)
        self._around = Surroundings(np.array(arena, float), obstacles)
        self._goals: Array | None = None
        """(N, 2) m, map: goals of all UAVs; None: not flying yet."""
        self._next = 0
        self._ticks = 0
        self._last_status = ""
        self._team = TeamLink(self, names, odometry, self._height)
        scan = str(self.declare_parameter("scan", "").value)
        self._scans = TeamScans(self, self._team, scan)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self.create_timer(_PERIOD_S, self._on_timer)

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot, with that of a behaviour that has one."""
        kept = self._behaviour.get_state() if isinstance(self._behaviour, Stateful) else None
        return {**super().get_state(), "behaviour": kept}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        if isinstance(self._behaviour, Stateful):
            self._behaviour.set_state(state["behaviour"])

    def _named_behaviour(self) -> SwarmBehaviour:
        known = self.BEHAVIOURS
        name = self.declare_parameter("behaviour", next(iter(known))).value
        if name not in known:
            raise PlanError(f"no swarm behaviour '{name}'; there are {', '.join(known)}")
        behaviour: SwarmBehaviour = known[name]()
        return behaviour

    def _rows(self, name: str, default: list[list[float]], width: int) -> Array:
        """Returns a parameter of rows of numbers (M, width). Raises `PlanError` for others."""
        rows = self.declare_parameter(name, default).value
        if any(len(row) != width for row in rows):
            raise PlanError(f"{name}: each entry has {width} numbers")
        return np.array(rows, float).reshape(-1, width)

    def _on_timer(self) -> None:
        team = self._team
        if self._goals is None:
            if not team.is_up():
                return
            self._goals = self._first_goals()
        now_ns = self.get_clock().now_ns()
        team.drop_lost(now_ns)
        if not team.members:
            return
        position, velocity = team.motion()
        goals = self._goals_now(position)
        flock = flock_within(position, velocity, self._behaviour.radius_m)
        preferred = self._preferred(goals - position)
        self._hostile.add_flight(position, preferred, now_ns)
        around = self._around._replace(echoes=self._scans.echoes(team.members, position))
        wanted = self._behaviour.velocities(flock, preferred, around)
        for row, level in zip(team.members, wanted, strict=True):
            team.command(row, level, self._height)
        self._ticks += 1
        if self._ticks % _STATUS_PERIODS == 0:
            self._publish_status(position, velocity, goals)

    def _first_goals(self) -> Array:
        """Returns the goals (N, 2) of each UAV; they count where each has its own."""
        if len(self._own_goals):
            return self._own_goals
        position, _ = self._team.motion()
        opposite: Array = 2.0 * position.mean(axis=0) - position
        return opposite

    def _goals_now(self, position: Array) -> Array:
        """Returns the present goals (M, 2) of the members; common ones keep the team's shape."""
        if (self._swaps or len(self._own_goals)) and self._goals is not None:
            own: Array = self._goals[self._team.members]
            return own
        middle = position.mean(axis=0)
        to_go = float(np.hypot(*(self._waypoints[self._next] - middle)))
        if to_go < self._arrival and self._next + 1 < len(self._waypoints):
            self._next += 1
        goals: Array = position + (self._waypoints[self._next] - middle)
        return goals

    def _preferred(self, offsets: Array) -> Array:
        """Returns velocities (M, 2) along offsets (M, 2) m to the goals."""
        distance = np.linalg.norm(offsets, axis=1, keepdims=True)
        speed = np.minimum(self._speed, _APPROACH * distance)
        preferred: Array = offsets / np.maximum(distance, 1e-9) * speed
        return preferred

    def _publish_status(self, position: Array, velocity: Array, goals: Array) -> None:
        apart = np.linalg.norm(position[:, None] - position, axis=2)
        apart[np.diag_indices(len(apart))] = math.inf
        headings = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-9)
        arrived = np.linalg.norm(goals - position, axis=1) < self._arrival
        status = {
            "members": len(position),
            "waypoint": self._next,
            "arrived": int(arrived.sum()),
            "order": round(float(np.linalg.norm(headings.mean(axis=0))), 3),
            "least_distance_m": round(float(apart.min()), 3) if len(apart) > 1 else None,
            "refused": self._team.num_refused,
        }
        self._last_status = publish_status(self._status, status, self._last_status)
