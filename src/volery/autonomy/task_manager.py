"""The task manager: one UAV's part in a search that a team shares out by radio.

Each UAV has one, and none leads. The area is a grid of sectors; a UAV that is free takes the one
that falls to it by what it has heard (`team.assignment`), has it explored, and tells the others
several times a second what it does, what has been searched and what has been found. So a report that
is lost, repeated or late does no harm, a UAV may come late or fall silent, and parts of a team that
do not hear each other go on, each by itself, until they do again.
"""  # noqa: E501

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.scan_points import Pose
from volery.autonomy.team.assignment import Claim, Worker, assign, must_yield
from volery.autonomy.team.mission_messages import goal_at, polygon_of
from volery.autonomy.team.reports import ALOFT, Phase, Team
from volery.autonomy.team.reports import TYPE as REPORT_TYPE
from volery.autonomy.team.sectors import Coverage, from_bits, to_bits
from volery.autonomy.team.settings import Settings
from volery.autonomy.team.target_list import Find, TargetList
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
from volery.core.kept import keep, put_back
from volery.graph.client import Client
from volery.graph.messages import (
    BatteryState,
    Odometry,
    Point,
    PolygonStamped,
    PoseStamped,
    Vector3,
    header,
    message_type,
    single,
    time_from_ns,
)
from volery.graph.node import Node

Array = NDArray[np.float64]

_TARGETS_TYPE = "volery_interfaces/msg/Targets"
_STATUS_TYPE = "volery_interfaces/msg/MissionStatus"
_PERIOD_S = 0.2
_REPEAT_S = 2.0
"""A take-off or landing that has not begun is asked for again."""
_POSE_S = 1.0
"""Without odometry for so long it does not know where it is."""
_RISE_S = 30.0
"""A take-off that takes longer has failed."""
_RETURN_STUCK_S = 60.0
"""Without coming nearer to home for so long it lands where it is."""
_HOME_M, _NEARER_M = 1.5, 1.0
_FALLEN_M, _LANDED_M, _STILL_M_S = 0.5, 0.3, 0.2
"""All modelling choices."""


class TaskManager(Node):
    """Takes off, has its sectors explored, shares what is found, comes home and lands.

    Says `search_area` (where to explore; no corners: nowhere), the goal to fly to on `goal_topic`,
    `mission`, `targets` and, for the radio, `team`. Hears odometry, `battery`,
    `target_detection/targets` and, from the radio, `radio/team`. `~/return_home` ends its search.

    Parameters
    ----------
    area_m: [x_min, y_min, x_max, y_max] in the map, the same for the whole team.
    sector_m: about how long a sector's sides are.
    altitude_m: height to which it takes off.
    cell_m, sight_m, enough: a sector is searched when this share of its cells has been in sight.
    gather_s: how long to listen for the team before the take-off.
    patience_s: after so long a silence a UAV counts as lost, and its sector is taken over.
    stuck_s: a sector in which nothing new has been seen for so long is given up.
    low_battery: charge, 0 to 1, at which it goes home.
    search_s: how long it searches at most; 0: without an end.
    alone_s: after so long without hearing anybody, once it has, it goes home; 0: it goes on.
    gate_m: finds nearer to each other than this are of one thing.
    odometry: topic of its pose in the map.
    goal_topic: where goals are published. Not `goal_pose`, to which flight modes fly straight on.

    """

    STATE = (
        "phase",
        "sector",
        "searched",
        "targets",
        "team",
        "trouble",
        "_pose",
        "_pose_ns",
        "_home",
        "_began_ns",
        "_phase_ns",
        "_since_ns",
        "_given_up",
        "_coverage",
        "_news_ns",
        "_battery",
        "_asked_ns",
        "_heard_ns",
        "_nearest_m",
        "_ordered_home",
    )
    """Everything that changes."""

    def __init__(self, **options: Any) -> None:
        super().__init__("task_manager", **options)
        self.settings = settings = Settings.declare(self)
        count = len(settings.sectors)
        self.phase = Phase.WAIT
        self.sector = -1
        self.searched = np.zeros(count, np.bool_)
        self.targets = TargetList(settings.gate_m)
        self.team = Team(count)
        self.trouble = ""
        self._pose: Pose | None = None
        self._pose_ns = 0
        self._home = np.zeros(3)
        self._began_ns: int | None = None
        self._phase_ns = 0
        self._since_ns = 0
        self._given_up = np.zeros(count, np.bool_)
        self._coverage: Coverage | None = None
        self._news_ns = 0
        """When something new was last seen, or home came nearer."""
        self._battery = math.nan
        self._asked_ns = -1 << 62
        self._heard_ns = 0
        self._nearest_m = math.inf
        self._ordered_home = False

        self._report_type = message_type(REPORT_TYPE)
        self._targets_type = message_type(_TARGETS_TYPE)
        self._status_type = message_type(_STATUS_TYPE)
        self._report = self.create_publisher(self._report_type, "team", 1)
        self._area = self.create_publisher(PolygonStamped, "search_area", 1, latched=True)
        self._goal = self.create_publisher(PoseStamped, settings.goal_topic, 1, latched=True)
        self._found = self.create_publisher(self._targets_type, "targets", 1, latched=True)
        self._status = self.create_publisher(self._status_type, "mission", 1)
        self._take_off = self.create_client("volery_interfaces/srv/TakeOffTo", "take_off_to")
        self._land = self.create_client("std_srvs/srv/Trigger", "land")
        self._hold = self.create_client("std_srvs/srv/Trigger", "hold")
        self.create_service("std_srvs/srv/Trigger", "~/return_home", self._on_return_home)
        self.create_subscription(Odometry, settings.odometry, self._on_odometry, 5)
        self.create_subscription(BatteryState, "battery", self._on_battery, 1)
        self.create_subscription(self._report_type, "radio/team", self._on_report, 20)
        self.create_subscription(self._targets_type, "target_detection/targets", self._on_finds, 5)
        self.create_timer(_PERIOD_S, self._on_timer)

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return keep(self, self.STATE)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        put_back(self, state)

    # ------------------------------------------------------------------------------ what it hears

    @property
    def _now_ns_here(self) -> int:
        return self.get_clock().now_ns()

    def _on_odometry(self, message: Odometry) -> None:
        pose = Pose.from_odometry(message)
        if not np.isfinite(pose.position).all():
            return
        self._pose, self._pose_ns = pose, self._now_ns_here
        coverage = self._coverage
        if coverage is not None and coverage.look(pose.position[:2], self.settings.sight_m):
            self._news_ns = self._pose_ns

    def _on_battery(self, message: BatteryState) -> None:
        self._battery = float(message.percentage)

    def _on_report(self, report: Any) -> None:
        now = self._now_ns_here
        if report.name == self.settings.name or not self.team.hear(report, now):
            return
        self._heard_ns = now
        self.searched |= from_bits(report.searched, len(self.searched))
        if self.targets.take(map(Find.from_message, report.targets)):
            self._tell_targets()

    def _on_finds(self, message: Any) -> None:
        finds = [Find.from_message(each) for each in message.targets]
        if self.targets.take(f._replace(finder=self.settings.name) for f in finds):
            self._tell_targets()
            self._tell_team()  # at once: the others shall know within a second

    def _on_return_home(self, _request: Any, response: Any) -> Any:
        self._ordered_home = True
        response.success, response.message = True, str(self.phase)
        return response

    # ------------------------------------------------------------------------------- what it does

    def _on_timer(self) -> None:
        now, pose = self._now_ns_here, self._pose
        if pose is None:
            return
        if self._began_ns is None:
            self._began_ns = self._heard_ns = now
            self._home = pose.position.copy()
            self._enter(Phase.WAIT)
        self.trouble = self._what_is_wrong(now)
        if now - self._pose_ns > _POSE_S * NS_PER_S and self.phase in ALOFT:
            self._ask_now_and_then(self._hold)
        else:
            self._act(pose, now)
        self._tell_team()
        self._tell_status()

    def _act(self, pose: Pose, now: int) -> None:
        if self.phase in (Phase.SEARCH, Phase.IDLE) and self._must_go_home(now):
            self._go_home(now)
        if self.phase is Phase.WAIT:
            if now - self._phase_ns >= self.settings.gather_s * NS_PER_S:
                self._enter(Phase.DONE if self._ordered_home else Phase.RISE)
        elif self.phase is Phase.RISE:
            self._rise(pose, now)
        elif self.phase is Phase.SEARCH:
            self._search(now)
        elif self.phase is Phase.IDLE:
            self._choose(now)
        elif self.phase is Phase.RETURN:
            self._return(pose, now)
        elif self.phase is Phase.LAND:
            self._sink(pose)

    def _rise(self, pose: Pose, now: int) -> None:
        climbed = pose.position[2] - self._home[2]
        if climbed > 0.8 * self.settings.altitude_m and abs(pose.velocity[2]) < _STILL_M_S:
            self._enter(Phase.IDLE)
        elif now - self._phase_ns > _RISE_S * NS_PER_S:
            self._enter(Phase.DOWN if climbed < _FALLEN_M else Phase.LAND)
        elif climbed < _LANDED_M:
            request = message_type("volery_interfaces/srv/TakeOffTo_Request")
            self._ask_now_and_then(self._take_off, request(self.settings.altitude_m))

    def _choose(self, now: int) -> None:
        """Take the sector that falls to this UAV; go home where none ever will."""
        workers = self.team.workers(now, self.settings.patience_s)
        workers[self.settings.name] = self._as_worker()
        chosen = assign(workers, self.searched, self.settings.sectors.centres())
        sector = chosen.get(self.settings.name, -1)
        if sector >= 0:
            self._begin(sector, now)
        elif (self.searched | self._given_up).all():
            self._go_home(now)

    def _begin(self, sector: int, now: int) -> None:
        self.sector, self._since_ns, self._news_ns = sector, now, now
        area = self.settings.sectors.of(sector)
        self._coverage = Coverage(area, self.settings.cell_m)
        self._enter(Phase.SEARCH)
        self._area.publish(polygon_of(area, float(self._home[2]), now))

    def _search(self, now: int) -> None:
        assert self._coverage is not None
        others = self.team.workers(now, self.settings.patience_s)
        mine = Claim(self._since_ns, self.settings.name)
        if self._coverage.share >= self.settings.enough:
            self.searched[self.sector] = True
            self._drop(now)
        elif self.searched[self.sector] or must_yield(mine, self.sector, others):
            self._drop(now)
        elif now - self._news_ns > self._patience_here_ns():
            self._given_up[self.sector] = True
            self._drop(now)

    def _patience_here_ns(self) -> int:
        """How long nothing new need be seen: on the way there, the way is given time too."""
        assert self._coverage is not None
        if self._coverage.seen.any() or self._pose is None:
            return round(self.settings.stuck_s * NS_PER_S)
        middle = self.settings.sectors.centres()[self.sector]
        way = float(np.linalg.norm(middle - self._pose.position[:2]))
        return round((self.settings.stuck_s + 2.0 * way) * NS_PER_S)

    def _drop(self, now: int) -> None:
        """Search this sector no more, and take the next one."""
        self.sector, self._coverage = -1, None
        self._enter(Phase.IDLE)
        self._choose(now)

    def _must_go_home(self, now: int) -> bool:
        assert self._began_ns is not None
        settings = self.settings
        over = 0.0 < settings.search_s * NS_PER_S < now - self._began_ns
        alone = bool(self.team.mates) and (0.0 < settings.alone_s * NS_PER_S < now - self._heard_ns)
        return self._ordered_home or over or alone or self._battery < settings.low_battery

    def _go_home(self, now: int) -> None:
        self.sector, self._coverage = -1, None
        self._nearest_m, self._news_ns = math.inf, now
        self._enter(Phase.RETURN)
        self._area.publish(polygon_of(None, float(self._home[2]), now))
        z = self._home[2] + self.settings.altitude_m
        self._goal.publish(goal_at(np.array([*self._home[:2], z]), now))

    def _return(self, pose: Pose, now: int) -> None:
        away = float(np.linalg.norm(pose.position[:2] - self._home[:2]))
        if away < self._nearest_m - _NEARER_M:
            self._nearest_m, self._news_ns = away, now
        if away < _HOME_M or now - self._news_ns > _RETURN_STUCK_S * NS_PER_S:
            self._enter(Phase.LAND)

    def _sink(self, pose: Pose) -> None:
        still = float(np.linalg.norm(pose.velocity)) < _STILL_M_S
        if still and self._now_ns_here - self._phase_ns > _REPEAT_S * NS_PER_S:
            self._enter(Phase.DONE)
        else:
            self._ask_now_and_then(self._land)

    # -------------------------------------------------------------------------------- what it says

    def _what_is_wrong(self, now: int) -> str:
        wrong = []
        if now - self._pose_ns > _POSE_S * NS_PER_S:
            wrong.append("no odometry")
        silent = sorted(
            name
            for name, mate in self.team.mates.items()
            if now - mate.heard_ns > self.settings.patience_s * NS_PER_S
            and mate.phase not in (Phase.DONE, Phase.DOWN)
        )
        if silent:
            wrong.append(f"silent: {', '.join(silent)}")
        if self._battery < self.settings.low_battery:
            wrong.append("low battery")
        if self.team.strangers:
            wrong.append(f"another search: {', '.join(sorted(self.team.strangers))}")
        return "; ".join(wrong)

    def _as_worker(self) -> Worker:
        assert self._pose is not None
        return Worker(self._pose.position[:2], self.sector, self._since_ns, self._given_up)

    def _tell_team(self) -> None:
        pose, now = self._pose, self._now_ns_here
        if pose is None:
            return
        self._report.publish(
            self._report_type(
                header(now, "map"),
                self.settings.name,
                str(self.phase),
                Point(*pose.position.tolist()),
                Vector3(*pose.velocity.tolist()),
                single(self._battery),
                len(self.searched),
                self.sector,
                time_from_ns(self._since_ns),
                to_bits(self.searched),
                to_bits(self._given_up),
                self.targets.messages(),
            )
        )

    def _tell_status(self) -> None:
        now = self._now_ns_here
        heard = [name for name, _ in self.team.heard(now, self.settings.patience_s)]
        self._status.publish(
            self._status_type(
                header(now, "map"),
                str(self.phase),
                self.sector,
                int(self.searched.sum()),
                len(self.searched),
                heard,
                len(self.targets.targets()),
                self.trouble,
            )
        )

    def _tell_targets(self) -> None:
        found = [find.message() for find in self.targets.targets()]
        self._found.publish(self._targets_type(header(self._now_ns_here, "map"), found))

    def _enter(self, phase: Phase) -> None:
        self.phase, self._phase_ns = phase, self._now_ns_here

    def _ask_now_and_then(self, client: Client, request: Any | None = None) -> None:
        """Call a service unless it was called lately."""
        now = self._now_ns_here
        if now - self._asked_ns < _REPEAT_S * NS_PER_S:
            return
        self._asked_ns = now
        try:
            client.call_async(request)
        except GraphError:
            return  # nobody offers it at the moment
