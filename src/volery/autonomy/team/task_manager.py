"""The task manager: one UAV's part in a search that a team shares out by radio.

Each UAV has one, and none leads. The area is a grid of sectors. A free UAV takes the sector that
`team.assignment` gives it by the reports it has received, has it explored, and publishes several
times a second its own state, the searched sectors and the targets. A lost, repeated or late report
does no harm, a UAV may join late or fall silent, and parts of a team that lose contact go on by
themselves until they meet again.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.planning.local_planner import TOO_DISTURBED
from volery.autonomy.team.assignment import SectorClaim, assign, must_yield
from volery.autonomy.team.ground_contact import STILL_M_S, GroundContact
from volery.autonomy.team.member import POSE_TIMEOUT_S, TeamMember
from volery.autonomy.team.mission_messages import goal_at, polygon_of
from volery.autonomy.team.sectors import Coverage
from volery.autonomy.team.settings import TeamSettings
from volery.autonomy.team.team_state import ALOFT, MissionPhase
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import (
    Bool,
    PolygonStamped,
    PoseStamped,
    Range,
    String,
    Twist,
    Vector3,
    message_type,
)
from volery.graph.nodes.node import Node
from volery.graph.nodes.service_client import Client

_PERIOD_S = 0.2
_REPEAT_S = 2.0
"""Period at which a take-off, a landing or the way home is requested until it begins."""
_CLIMB_M_S, _CLIMB_END_M = 1.0, 0.3
"""Climb rate in the air, and the distance below the altitude at which it ends."""
_RISE_TIMEOUT_S = 30.0
"""Duration after which a take-off has failed."""
_RETURN_TIMEOUT_S = 60.0
"""Duration without progress towards home after which the UAV lands."""
_LOST_TIMEOUT_S = 30.0
"""Duration without a position after which the UAV lands."""
_DISTURBED_TIMEOUT_S = 15.0
"""Duration for which a planner holds because of disturbances after which the UAV lands."""
_HOME_M, _NEARER_M = 1.5, 1.0
_STOPPED_M_S = 0.3
"""Speed over ground below which a UAV over home has stopped, and may land."""
_LANDED_M, _SUNK_M = 0.3, 0.25
_NEVER_NS = -1 << 62
HELD, LANDED = "held by the operator", "landed by the operator"
BLOWN = f"landed: {TOO_DISTURBED}"
DOWN = "came down, and not by its mission"
"""All limits are modelling choices."""
"""All attributes that change."""
_PARTS = ("member", "ground")


class TaskManager(SavedAttributes, Node):
    """Takes off, has its sectors explored, shares targets, returns home and lands.

    Publishes `search_area` (area to explore; no corners: none), the goal on `goal_topic`,
    `mission`, `targets` and, for the radio, `team`. Subscribes to odometry, `battery`, `range`,
    `target_detection/targets` and, from the radio, `radio/team`.
    Services: `~/return_home` ends the search; `~/hold` and `~/land` make the UAV hold or land and
    leave its sector to others, until `~/resume`. While it holds, `planning/pause` (std_msgs/Bool)
    stops the planners. A UAV that stands on the ground by its sonar without an order to land gives
    its sector up.
    A local planner may publish on `planning/status` (JSON) that disturbances push the UAV too far
    off its plans; after 15 s of this the UAV lands where it is.
    An explorer may publish on `exploration/status` (JSON with a `state`: searching, then done or
    blocked) that it is through with an area; else the cells in sight decide.

    Parameters
    ----------
    area_m: [x_min, y_min, x_max, y_max] in the map, the same for the whole team.
    sector_m: approximate side of a sector.
    altitude_m: height to which the UAV takes off.
    resolution_m, view_radius_m, coverage_fraction: a sector is searched when this fraction of its
        cells has been in sight.
    gather_s: duration of listening for the team before the take-off.
    timeout_s: silence after which a UAV counts as lost, and its sector is taken over.
    stuck_timeout_s: duration without new cells in sight after which a sector is given up.
    low_battery_fraction: charge, 0 to 1, at which the UAV returns home.
    max_search_s: maximum duration of the search; 0: none.
    team_timeout_s: silence of all others after which the UAV returns home; 0: it goes on.
    gate_m: detections closer to each other than this are one target.
    odometry: topic of the pose; use_map_tf: whether `/tf` transforms its frame into the map.
    goal_topic: topic of goals. Not `goal_pose`, to which flight modes fly straight.

    """

    PARTS = ("member", "ground")
    STATE = (
        "problem",
        "_home",
        "_began_ns",
        "_phase_ns",
        "_requested_ns",
        "_nearest_m",
        "_highest_m",
        "_ordered_home",
        "_order",
        "_paused",
        "_has_risen",
        "_climbs",
        "_explores",
        "_disturbed_ns",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("task_manager", **options)
        self.settings = TeamSettings.declare(self)
        self.problem = ""
        """What an operator should know; empty: nothing."""
        self._home = np.zeros(3)
        self._began_ns: int | None = None
        self._phase_ns = 0
        self._requested_ns = _NEVER_NS
        self._nearest_m = math.inf
        """Smallest distance to home so far."""
        self._highest_m = -math.inf
        """Greatest height since the landing began."""
        self._ordered_home = False
        self._order = ""
        """The operator's order, in words; empty: none."""
        self._paused = False
        self._has_risen = False
        """Whether the last climb is complete."""
        self._climbs = False
        """Whether the UAV climbs from the air, which no take-off does."""
        self._explores = False
        """Whether the explorer has begun with the present sector."""
        self._disturbed_ns: int | None = None
        """Time since when the local planner holds because of disturbances; None: it does not."""
        self.member = TeamMember(self, self.settings)
        self.ground = GroundContact()
        self._phases: dict[MissionPhase, Callable[[OdometrySample, int], None]] = {
            MissionPhase.WAIT: self._wait,
            MissionPhase.RISE: self._rise,
            MissionPhase.SEARCH: self._search,
            MissionPhase.IDLE: self._choose,
            MissionPhase.RETURN: self._return,
            MissionPhase.LAND: self._sink,
        }
        self._area = self.create_publisher(PolygonStamped, "search_area", 1, latched=True)
        self._goal = self.create_publisher(PoseStamped, self.settings.goal_topic, 1, latched=True)
        self._take_off = self.create_client("volery_interfaces/srv/TakeOffTo", "take_off_to")
        self._land = self.create_client("std_srvs/srv/Trigger", "land")
        self._hold = self.create_client("std_srvs/srv/Trigger", "hold")
        self._command = self.create_publisher(Twist, "cmd_vel", 1)
        self._pause = self.create_publisher(Bool, "planning/pause", 1, latched=True)
        for order in ("return_home", "hold", "land", "resume"):
            self.create_service("std_srvs/srv/Trigger", f"~/{order}", getattr(self, f"_on_{order}"))
        self.create_subscription(Range, "range", self._on_range, 5)
        self.create_subscription(String, "exploration/status", self._on_explorer, 5)
        self.create_subscription(String, "planning/status", self._on_planner, 5)
        self.create_timer(_PERIOD_S, self._on_timer)

    @property
    def phase(self) -> MissionPhase:
        """The present phase of the mission."""
        return self.member.phase

    @property
    def _now_ns(self) -> int:
        return self.get_clock().now_ns()

    def _on_range(self, message: Range) -> None:
        self.ground.on_range(message, self._now_ns)

    def _on_explorer(self, message: String) -> None:
        """Marks the sector by an explorer's state: searched, or given up."""
        now, member = self._now_ns, self.member
        state = str(_status_in(message.data).get("state", ""))
        if state == "searching":
            self._explores = True
        elif self._explores and self.phase is MissionPhase.SEARCH and state in ("done", "blocked"):
            member.searched[member.sector] = state == "done"
            member.given_up[member.sector] |= state == "blocked"
            self._drop(now)

    def _on_planner(self, message: String) -> None:
        problems = _status_in(message.data).get("problems")
        if isinstance(problems, list) and TOO_DISTURBED in problems:
            self._disturbed_ns = self._now_ns if self._disturbed_ns is None else self._disturbed_ns
        else:
            self._disturbed_ns = None

    # ---------------------------------------------------------------------------- operator's orders

    def _on_return_home(self, _request: Any, response: Any) -> Any:
        self._ordered_home = True
        now, aloft = self._now_ns, self._is_aloft()
        waits = self.phase in (MissionPhase.HOLD, MissionPhase.DONE, MissionPhase.DOWN)
        if (aloft and waits) or self._lands_by_order():
            self._call(self._hold)  # ends what else is flown
            self._go_home(now)
        return _answer(response, True, "goes home and lands" if aloft else "stays on the ground")

    def _on_hold(self, _request: Any, response: Any) -> Any:
        if not self._is_aloft():
            return _answer(response, False, f"it is not in the air ({self.phase})")
        self._suspend(MissionPhase.HOLD, HELD)
        self._call(self._hold)
        return _answer(response, True, "holds until resume, return or land")

    def _on_land(self, _request: Any, response: Any) -> Any:
        if not self._is_aloft():
            self._ordered_home = True
            return _answer(response, True, "stays on the ground until resume")
        self._suspend(MissionPhase.LAND, LANDED)
        self._requested_ns = _NEVER_NS  # `land` is requested with the next tick
        return _answer(response, True, "lands, and stays there until resume")

    def _on_resume(self, _request: Any, response: Any) -> Any:
        pose = self.member.pose
        if pose is None or self._began_ns is None:
            return _answer(response, False, "it does not know where it is")
        self._ordered_home = False
        if self._must_go_home(self._now_ns):
            return _answer(response, False, "it must be at home: battery, time or radio")
        if self.phase in (
            MissionPhase.WAIT,
            MissionPhase.RISE,
            MissionPhase.SEARCH,
            MissionPhase.IDLE,
        ):
            return _answer(response, True, "searches already")
        height_m = float(pose.position[2])
        if self._is_aloft():
            if self.phase is not MissionPhase.RETURN:
                self._call(self._hold)
            self._search_or_climb(height_m)
        else:
            self.ground.stand_m = height_m
            self._requested_ns = _NEVER_NS
            self._enter(MissionPhase.RISE)
        self._order = ""
        self._set_pause(False)
        return _answer(response, True, "searches")

    def _search_or_climb(self, height_m: float) -> None:
        """Resumes in the air; climbs first where planners plan nothing. height_m: in the map."""
        is_low = self.ground.is_low(height_m, self._now_ns)
        self._enter(MissionPhase.RISE if is_low or not self._has_risen else MissionPhase.IDLE)
        self._climbs = self.phase is MissionPhase.RISE

    def _is_aloft(self) -> bool:
        """Whether the UAV flies, by this node's order or another's."""
        pose = self.member.pose
        if pose is None or self.phase is MissionPhase.WAIT:
            return False
        stands = self.phase in (MissionPhase.DONE, MissionPhase.DOWN)
        return not stands or self.ground.is_above_stand(pose)

    def _lands_by_order(self) -> bool:
        return self.phase is MissionPhase.LAND and bool(self._order)

    def _suspend(self, phase: MissionPhase, order: str) -> None:
        """Leaves the sector to others and stops the planners."""
        self._order = order
        self._leave_sector(self._now_ns)
        self._set_pause(True)
        self._enter(phase)

    def _set_pause(self, paused: bool) -> None:
        if paused != self._paused:
            self._paused = paused
            self._pause.publish(Bool(paused))

    # -------------------------------------------------------------------------------------- phases

    def _on_timer(self) -> None:
        now, member = self._now_ns, self.member
        pose = member.pose
        if pose is None:
            return
        if self._began_ns is None:
            self._begin(pose, now)
        self.problem = "; ".join(filter(None, (self._order, member.problems())))
        lost_s = (now - member.pose_ns) / NS_PER_S
        if lost_s > POSE_TIMEOUT_S and self.phase in ALOFT:
            self._wait_or_land(lost_s)
        else:
            self._act(pose, now)
        member.publish_report()
        member.publish_status(self.problem)

    def _begin(self, pose: OdometrySample, now: int) -> None:
        self._began_ns = self.member.received_ns = now
        self._home = pose.position.copy()
        self.ground.stand_m = float(self._home[2])
        self._enter(MissionPhase.WAIT)

    def _act(self, pose: OdometrySample, now: int) -> None:
        if self.phase in ALOFT and self.ground.has_come_down(pose, now):
            self._suspend(MissionPhase.DOWN, DOWN)
        elif self.phase in ALOFT and self._is_blown(now):
            self._suspend(MissionPhase.LAND, BLOWN)
        elif self._turns_home(now):
            self._go_home(now)
        run = self._phases.get(self.phase)
        if run is not None:
            run(pose, now)

    def _wait_or_land(self, lost_s: float) -> None:
        """Holds until the position is known again; lands after a timeout."""
        if lost_s < _LOST_TIMEOUT_S:
            self._request_at_intervals(self._hold)
            return
        if self.phase is not MissionPhase.LAND:
            self._enter(MissionPhase.LAND)
        self._request_at_intervals(self._land)

    def _wait(self, _pose: OdometrySample, now: int) -> None:
        if now - self._phase_ns >= self.settings.gather_s * NS_PER_S:
            self._enter(MissionPhase.DONE if self._ordered_home else MissionPhase.RISE)

    def _rise(self, pose: OdometrySample, now: int) -> None:
        climbed = pose.position[2] - self.ground.stand_m
        if climbed > 0.8 * self.settings.altitude_m and abs(pose.velocity[2]) < STILL_M_S:
            self._has_risen = True
            self._enter(MissionPhase.IDLE)
        elif now - self._phase_ns > _RISE_TIMEOUT_S * NS_PER_S:
            self._enter(MissionPhase.DOWN if climbed < _LANDED_M else MissionPhase.LAND)
        elif self._climbs:
            if climbed < self.settings.altitude_m - _CLIMB_END_M:
                self._command.publish(Twist(Vector3(0.0, 0.0, _CLIMB_M_S), Vector3(0.0, 0.0, 0.0)))
        elif climbed < _LANDED_M:
            request = message_type("volery_interfaces/srv/TakeOffTo_Request")
            self._request_at_intervals(self._take_off, request(self.settings.altitude_m))

    def _choose(self, _pose: OdometrySample, now: int) -> None:
        """Takes the sector that is assigned to this UAV; returns home where none is left."""
        member = self.member
        chosen = assign(member.workers(), member.searched, self.settings.sectors.centres())
        sector = chosen.get(self.settings.name, -1)
        if sector >= 0:
            self._begin_sector(sector, now)
        elif (member.searched | member.given_up).all():
            self._go_home(now)

    def _begin_sector(self, sector: int, now: int) -> None:
        self._explores = False
        area = self.settings.sectors.of(sector)
        self.member.take_sector(sector, Coverage(area, self.settings.resolution_m))
        self._enter(MissionPhase.SEARCH)
        self._area.publish(polygon_of(area, float(self._home[2]), now))

    def _search(self, _pose: OdometrySample, now: int) -> None:
        member = self.member
        assert member.coverage is not None
        claim = SectorClaim(member.since_ns, self.settings.name)
        if member.coverage.covered_fraction >= self.settings.coverage_fraction:
            member.searched[member.sector] = True
            self._drop(now)
        elif member.searched[member.sector] or must_yield(
            claim, member.sector, member.other_workers()
        ):
            self._drop(now)
        elif now - member.progress_ns > self._sector_timeout_ns():
            member.given_up[member.sector] = True
            self._drop(now)

    def _sector_timeout_ns(self) -> int:
        """Returns the maximum duration without progress; the flight to the sector counts extra."""
        member = self.member
        assert member.coverage is not None
        if member.coverage.seen.any() or member.pose is None:
            return round(self.settings.stuck_timeout_s * NS_PER_S)
        centre = self.settings.sectors.centres()[member.sector]
        distance = norm(centre - member.pose.position[:2])
        return round((self.settings.stuck_timeout_s + 2.0 * distance) * NS_PER_S)

    def _drop(self, now: int) -> None:
        """Leaves this sector and takes the next one."""
        member = self.member
        member.leave_sector()
        self._enter(MissionPhase.IDLE)
        assert member.pose is not None
        self._choose(member.pose, now)
        if self.phase is MissionPhase.IDLE:
            self._area.publish(polygon_of(None, float(self._home[2]), now))

    def _is_blown(self, now: int) -> bool:
        since_ns = self._disturbed_ns
        return since_ns is not None and now - since_ns > _DISTURBED_TIMEOUT_S * NS_PER_S

    def _turns_home(self, now: int) -> bool:
        """Whether the UAV returns home now; while it is held, only for its battery."""
        if self.phase is MissionPhase.HOLD:
            return self.member.battery < self.settings.low_battery_fraction
        return self.phase in (MissionPhase.SEARCH, MissionPhase.IDLE) and self._must_go_home(now)

    def _must_go_home(self, now: int) -> bool:
        assert self._began_ns is not None
        settings, member = self.settings, self.member
        over = 0.0 < settings.max_search_s * NS_PER_S < now - self._began_ns
        silence_ns = now - member.received_ns
        alone = bool(member.team.mates) and (0.0 < settings.team_timeout_s * NS_PER_S < silence_ns)
        return self._ordered_home or over or alone or member.battery < settings.low_battery_fraction

    def _go_home(self, now: int) -> None:
        self._nearest_m, self.member.progress_ns = math.inf, now
        self._order = ""
        self._set_pause(False)
        self._enter(MissionPhase.RETURN)
        self._leave_sector(now)
        self._send_home(now)

    def _leave_sector(self, now: int) -> None:
        self.member.leave_sector()
        self._area.publish(polygon_of(None, float(self._home[2]), now))

    def _send_home(self, now: int) -> None:
        self._requested_ns = now
        z = self._home[2] + self.settings.altitude_m
        self._goal.publish(goal_at(np.array([*self._home[:2], z]), now))

    def _return(self, pose: OdometrySample, now: int) -> None:
        if now - self._requested_ns >= _REPEAT_S * NS_PER_S:
            self._send_home(now)  # the explorer may have published a goal since
        distance = norm(pose.position[:2] - self._home[:2])
        if distance < self._nearest_m - _NEARER_M:
            self._nearest_m, self.member.progress_ns = distance, now
        timeout_ns = _RETURN_TIMEOUT_S * NS_PER_S
        hovers = distance < _HOME_M and norm(pose.velocity[:2]) < _STOPPED_M_S
        if hovers or now - self.member.progress_ns > timeout_ns:
            self._enter(MissionPhase.LAND)

    def _sink(self, pose: OdometrySample, _now: int) -> None:
        self._highest_m = max(self._highest_m, float(pose.position[2]))
        still = norm(pose.velocity) < STILL_M_S
        if still and pose.position[2] < self._highest_m - _SUNK_M:
            self._enter(MissionPhase.DONE)
        else:
            self._request_at_intervals(self._land)

    def _enter(self, phase: MissionPhase) -> None:
        self._highest_m = -math.inf
        self._climbs = False
        self.member.phase, self._phase_ns = phase, self._now_ns
        if phase in (MissionPhase.DONE, MissionPhase.DOWN):
            self._has_risen = False
            if self.member.pose is not None:
                self.ground.stand_m = float(self.member.pose.position[2])

    def _request_at_intervals(self, client: Client, request: Any | None = None) -> None:
        """Calls a service unless it was called within the last two seconds."""
        now = self._now_ns
        if now - self._requested_ns < _REPEAT_S * NS_PER_S:
            return
        self._requested_ns = now
        self._call(client, request)

    def _call(self, client: Client, request: Any | None = None) -> None:
        """Calls a service if it has a server."""
        with contextlib.suppress(GraphError):
            client.call_async(request)


def _answer(response: Any, success: bool, message: str) -> Any:
    response.success, response.message = success, message
    return response


def _status_in(text: str) -> dict[str, Any]:
    """Returns a JSON object; an empty one where the text is none."""
    try:
        status = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return {}
    return status if isinstance(status, dict) else {}
