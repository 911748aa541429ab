"""The task manager: one UAV's part in a search that a team shares out by radio.

Each UAV has one, and none leads. The area is a grid of sectors; a UAV that is free takes the one
that falls to it by what it has heard (`team.assignment`), has it explored, and tells the others
several times a second what it does, what has been searched and what has been found. So a report
that is lost, repeated or late does no harm, a UAV may come late or fall silent, and parts of a team
that do not hear each other go on, each by itself, until they do again.
"""

from __future__ import annotations

import contextlib
import json
import math
from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.team.assignment import SectorClaim, assign, must_yield
from volery.autonomy.team.member import POSE_S, TeamMember
from volery.autonomy.team.mission_messages import goal_at, polygon_of
from volery.autonomy.team.sectors import Coverage
from volery.autonomy.team.team_state import ALOFT, MissionPhase
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
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
from volery.graph.nodes.service_client import Client

_PERIOD_S = 0.2
_REPEAT_S = 2.0
"""A take-off or landing that has not begun is asked for again, and the way home."""
_LOW_M, _SONAR_S = 1.5, 1.0
"""Lower than this by a sonar heard so lately it climbs before it searches: planners plan nothing
near the ground."""
_CLIMB_M_S, _CLIMB_END_M = 1.0, 0.3
"""How fast it climbs then, and how far below its height the speed is asked for no more."""
_RISE_S = 30.0
"""A take-off that takes longer has failed."""
_RETURN_STUCK_S = 60.0
"""Without coming nearer to home for so long it lands where it is."""
_LOST_S = 30.0
"""After so long without knowing where it is it lands."""
_HOME_M, _NEARER_M = 1.5, 1.0
_LANDED_M, _SUNK_M, _STILL_M_S = 0.3, 0.25, 0.2
_ALOFT_M = 0.6
"""Farther than this above where it stood last it flies again."""
_GROUND_M, _GROUND_S = 0.35, 2.0
"""So near to the ground by its sonar, and still, for so long: it stands on it."""
HELD, LANDED = "held by the operator", "landed by the operator"
DOWN = "came down, and not by its mission"
"""All modelling choices."""


class TaskManager(TeamMember):
    """Takes off, has its sectors explored, shares what is found, comes home and lands.

    Says `search_area` (where to explore; no corners: nowhere), the goal to fly to on `goal_topic`,
    `mission`, `targets` and, for the radio, `team`. Hears odometry, `battery`,
    `target_detection/targets` and, from the radio, `radio/team`.
    People's orders are services: `~/return_home` ends its search, `~/hold` and `~/land` have it
    wait where it is or land there, its sector left to others, until `~/resume`. While it holds
    `planning/pause` (std_msgs/Bool) has planners command nothing. One that stands on the ground by
    its sonar (`range`) though nothing here had it land gives its sector up, too.
    An explorer may tell on `exploration/status` (JSON with a `state`: searching, then done or
    blocked) that it is through with an area; else what has been in sight decides.

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
    odometry: topic of its pose; corrected: whether `/tf` tells where its frame lies in the map.
    goal_topic: where goals are published. Not `goal_pose`, to which flight modes fly straight on.

    """

    STATE = (
        "_home",
        "_began_ns",
        "_phase_ns",
        "_asked_ns",
        "_nearest_m",
        "_highest_m",
        "_ordered_home",
        "_order",
        "_paused",
        "_stands_m",
        "_low_ns",
        "_sonar_m",
        "_sonar_ns",
        "_has_risen",
        "_climbs",
        "_explores",
        *TeamMember.STATE,
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("task_manager", **options)
        self._home = np.zeros(3)
        self._began_ns: int | None = None
        self._phase_ns = 0
        self._asked_ns = -1 << 62
        self._nearest_m = math.inf
        """To home, so far."""
        self._highest_m = -math.inf
        """Since the landing began."""
        self._ordered_home = False
        self._order = ""
        """What an operator has it do, in words; empty: nothing."""
        self._paused = False
        self._stands_m = 0.0
        """Height in the map of the place on which it stood last, and ..."""
        self._low_ns: int | None = None
        """... since when its sonar says that it stands on the ground; None: it does not."""
        self._sonar_m, self._sonar_ns = math.inf, -1 << 62
        """Height above ground by its sonar, and when it said so."""
        self._has_risen = False
        """Whether the last climb has come to its end."""
        self._climbs = False
        """Whether it rises from a place in the air, which no take-off does."""
        self._explores = False
        """Whether the explorer has taken up the present sector."""
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
        self.create_timer(_PERIOD_S, self._on_timer)

    def _on_explorer(self, message: String) -> None:
        """An explorer that says when it is done with an area, or cannot get on in it."""
        now, state = self.now_ns, _state_in(message.data)
        if state == "searching":
            self._explores = True
        elif self._explores and self.phase is MissionPhase.SEARCH and state in ("done", "blocked"):
            self.searched[self.sector] = state == "done"
            self._given_up[self.sector] |= state == "blocked"
            self._drop(now)

    def _on_range(self, message: Range) -> None:
        self._sonar_m, self._sonar_ns = max(float(message.range), 0.0), self.now_ns
        if not (message.range <= _GROUND_M):  # too near to be measured is -inf
            self._low_ns = None
        elif self._low_ns is None:
            self._low_ns = self.now_ns

    # ------------------------------------------------------------------------------ people's orders

    def _on_return_home(self, _request: Any, response: Any) -> Any:
        self._ordered_home = True
        now, aloft = self.now_ns, self._is_aloft()
        waits = self.phase in (MissionPhase.HOLD, MissionPhase.DONE, MissionPhase.DOWN)
        if (aloft and waits) or self._lands_by_order():
            self._call(self._hold)  # ends what else is flown
            self._go_home(now)
        return _answer(response, True, "goes home and lands" if aloft else "stays on the ground")

    def _on_hold(self, _request: Any, response: Any) -> Any:
        if not self._is_aloft():
            return _answer(response, False, f"it is not in the air ({self.phase})")
        self._give_way(MissionPhase.HOLD, HELD)
        self._call(self._hold)
        return _answer(response, True, "holds until resume, return or land")

    def _on_land(self, _request: Any, response: Any) -> Any:
        if not self._is_aloft():
            self._ordered_home = True
            return _answer(response, True, "stays on the ground until resume")
        self._give_way(MissionPhase.LAND, LANDED)
        self._asked_ns = -1 << 62  # `land` is asked for with the next tick
        return _answer(response, True, "lands, and stays there until resume")

    def _on_resume(self, _request: Any, response: Any) -> Any:
        if self._pose is None or self._began_ns is None:
            return _answer(response, False, "it does not know where it is")
        self._ordered_home = False
        if self._must_go_home(self.now_ns):
            return _answer(response, False, "it must be at home: battery, time or radio")
        if self.phase in (
            MissionPhase.WAIT,
            MissionPhase.RISE,
            MissionPhase.SEARCH,
            MissionPhase.IDLE,
        ):
            return _answer(response, True, "searches already")
        if self._is_aloft():
            if self.phase is not MissionPhase.RETURN:
                self._call(self._hold)
            self._search_or_climb(float(self._pose.position[2]))
        else:
            self._stands_m = float(self._pose.position[2])
            self._asked_ns = -1 << 62
            self._enter(MissionPhase.RISE)
        self._order = ""
        self._set_pause(False)
        return _answer(response, True, "searches")

    def _search_or_climb(self, height_m: float) -> None:
        """Go on in the air, at a height in the map: first upwards where planners would not plan."""
        is_low = self.now_ns - self._sonar_ns < _SONAR_S * NS_PER_S and self._sonar_m < _LOW_M
        if is_low:
            self._stands_m = height_m - self._sonar_m
        self._enter(MissionPhase.RISE if is_low or not self._has_risen else MissionPhase.IDLE)
        self._climbs = self.phase is MissionPhase.RISE

    def _is_aloft(self) -> bool:
        """Whether it flies, whoever had it take off."""
        if self._pose is None or self.phase is MissionPhase.WAIT:
            return False
        stands = self.phase in (MissionPhase.DONE, MissionPhase.DOWN)
        return not stands or self._pose.position[2] > self._stands_m + _ALOFT_M

    def _lands_by_order(self) -> bool:
        return self.phase is MissionPhase.LAND and bool(self._order)

    def _give_way(self, phase: MissionPhase, order: str) -> None:
        """Leave the sector to others and have planners command nothing."""
        self._order = order
        self._leave_sector(self.now_ns)
        self._set_pause(True)
        self._enter(phase)

    def _set_pause(self, paused: bool) -> None:
        if paused != self._paused:
            self._paused = paused
            self._pause.publish(Bool(paused))

    def what_is_wrong(self, now: int) -> str:
        """As of every member of the team, and what an operator has it do."""
        return "; ".join(filter(None, (self._order, super().what_is_wrong(now))))

    # ------------------------------------------------------------------------------- what it does

    def _on_timer(self) -> None:
        now, pose = self.now_ns, self._pose
        if pose is None:
            return
        if self._began_ns is None:
            self._began_ns = self._heard_ns = now
            self._home = pose.position.copy()
            self._stands_m = float(self._home[2])
            self._enter(MissionPhase.WAIT)
        self.problem = self.what_is_wrong(now)
        lost_s = (now - self._pose_ns) / NS_PER_S
        if lost_s > POSE_S and self.phase in ALOFT:
            self._wait_or_land(lost_s)
        else:
            self._act(pose, now)
        self.tell_team()
        self.tell_status()

    def _act(self, pose: OdometrySample, now: int) -> None:
        if self.phase in ALOFT and self._has_come_down(pose, now):
            self._give_way(MissionPhase.DOWN, DOWN)
        elif self._turns_home(now):
            self._go_home(now)
        if self.phase is MissionPhase.WAIT:
            if now - self._phase_ns >= self.settings.gather_s * NS_PER_S:
                self._enter(MissionPhase.DONE if self._ordered_home else MissionPhase.RISE)
        elif self.phase is MissionPhase.RISE:
            self._rise(pose, now)
        elif self.phase is MissionPhase.SEARCH:
            self._search(now)
        elif self.phase is MissionPhase.IDLE:
            self._choose(now)
        elif self.phase is MissionPhase.RETURN:
            self._return(pose, now)
        elif self.phase is MissionPhase.LAND:
            self._sink(pose)

    def _has_come_down(self, pose: OdometrySample, now: int) -> bool:
        """Whether it has stood on the ground for a while, by its sonar."""
        if self._low_ns is None or norm(pose.velocity) >= _STILL_M_S:
            return False
        return now - self._low_ns > _GROUND_S * NS_PER_S

    def _wait_or_land(self, lost_s: float) -> None:
        """Stay until it knows where it is again; land where that takes too long."""
        if lost_s < _LOST_S:
            self._ask_now_and_then(self._hold)
            return
        if self.phase is not MissionPhase.LAND:
            self._enter(MissionPhase.LAND)
        self._ask_now_and_then(self._land)

    def _rise(self, pose: OdometrySample, now: int) -> None:
        climbed = pose.position[2] - self._stands_m
        if climbed > 0.8 * self.settings.altitude_m and abs(pose.velocity[2]) < _STILL_M_S:
            self._has_risen = True
            self._enter(MissionPhase.IDLE)
        elif now - self._phase_ns > _RISE_S * NS_PER_S:
            self._enter(MissionPhase.DOWN if climbed < _LANDED_M else MissionPhase.LAND)
        elif self._climbs:
            if climbed < self.settings.altitude_m - _CLIMB_END_M:
                self._command.publish(Twist(Vector3(0.0, 0.0, _CLIMB_M_S), Vector3(0.0, 0.0, 0.0)))
        elif climbed < _LANDED_M:
            request = message_type("volery_interfaces/srv/TakeOffTo_Request")
            self._ask_now_and_then(self._take_off, request(self.settings.altitude_m))

    def _choose(self, now: int) -> None:
        """Take the sector that falls to this UAV; go home where none ever will."""
        workers = self.team.workers(now, self.settings.patience_s)
        workers[self.settings.name] = self.as_worker()
        chosen = assign(workers, self.searched, self.settings.sectors.centres())
        sector = chosen.get(self.settings.name, -1)
        if sector >= 0:
            self._begin(sector, now)
        elif (self.searched | self._given_up).all():
            self._go_home(now)

    def _begin(self, sector: int, now: int) -> None:
        self.sector, self._since_ns, self._news_ns = sector, now, now
        self._explores = False
        area = self.settings.sectors.of(sector)
        self._coverage = Coverage(area, self.settings.cell_m)
        self._enter(MissionPhase.SEARCH)
        self._area.publish(polygon_of(area, float(self._home[2]), now))

    def _search(self, now: int) -> None:
        assert self._coverage is not None
        others = self.team.workers(now, self.settings.patience_s)
        mine = SectorClaim(self._since_ns, self.settings.name)
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
        way = norm(middle - self._pose.position[:2])
        return round((self.settings.stuck_s + 2.0 * way) * NS_PER_S)

    def _drop(self, now: int) -> None:
        """Search this sector no more, and take the next one."""
        self.sector, self._coverage = -1, None
        self._enter(MissionPhase.IDLE)
        self._choose(now)
        if self.phase is MissionPhase.IDLE:
            self._area.publish(polygon_of(None, float(self._home[2]), now))

    def _turns_home(self, now: int) -> bool:
        """Whether it goes home now; held by an operator, only for its battery."""
        if self.phase is MissionPhase.HOLD:
            return self._battery < self.settings.low_battery
        return self.phase in (MissionPhase.SEARCH, MissionPhase.IDLE) and self._must_go_home(now)

    def _must_go_home(self, now: int) -> bool:
        assert self._began_ns is not None
        settings = self.settings
        over = 0.0 < settings.search_s * NS_PER_S < now - self._began_ns
        alone = bool(self.team.mates) and (0.0 < settings.alone_s * NS_PER_S < now - self._heard_ns)
        return self._ordered_home or over or alone or self._battery < settings.low_battery

    def _go_home(self, now: int) -> None:
        self._nearest_m, self._news_ns = math.inf, now
        self._order = ""
        self._set_pause(False)
        self._enter(MissionPhase.RETURN)
        self._leave_sector(now)
        self._send_home(now)

    def _leave_sector(self, now: int) -> None:
        self.sector, self._coverage = -1, None
        self._area.publish(polygon_of(None, float(self._home[2]), now))

    def _send_home(self, now: int) -> None:
        self._asked_ns = now
        z = self._home[2] + self.settings.altitude_m
        self._goal.publish(goal_at(np.array([*self._home[:2], z]), now))

    def _return(self, pose: OdometrySample, now: int) -> None:
        if now - self._asked_ns >= _REPEAT_S * NS_PER_S:
            self._send_home(now)  # a goal that the explorer chose before may have come since
        away = norm(pose.position[:2] - self._home[:2])
        if away < self._nearest_m - _NEARER_M:
            self._nearest_m, self._news_ns = away, now
        if away < _HOME_M or now - self._news_ns > _RETURN_STUCK_S * NS_PER_S:
            self._enter(MissionPhase.LAND)

    def _sink(self, pose: OdometrySample) -> None:
        self._highest_m = max(self._highest_m, float(pose.position[2]))
        still = norm(pose.velocity) < _STILL_M_S
        if still and pose.position[2] < self._highest_m - _SUNK_M:
            self._enter(MissionPhase.DONE)
        else:
            self._ask_now_and_then(self._land)

    def _enter(self, phase: MissionPhase) -> None:
        self._highest_m = -math.inf
        self._climbs = False
        if phase in (MissionPhase.DONE, MissionPhase.DOWN):
            self._has_risen = False
        self.phase, self._phase_ns = phase, self.now_ns
        if phase in (MissionPhase.DONE, MissionPhase.DOWN) and self._pose is not None:
            self._stands_m = float(self._pose.position[2])

    def _ask_now_and_then(self, client: Client, request: Any | None = None) -> None:
        """Call a service unless it was called lately."""
        now = self.now_ns
        if now - self._asked_ns < _REPEAT_S * NS_PER_S:
            return
        self._asked_ns = now
        self._call(client, request)

    def _call(self, client: Client, request: Any | None = None) -> None:
        """Call a service, where somebody offers it."""
        with contextlib.suppress(GraphError):
            client.call_async(request)


def _answer(response: Any, success: bool, message: str) -> Any:
    response.success, response.message = success, message
    return response


def _state_in(text: str) -> str:
    """The `state` of a JSON text; empty where there is none."""
    try:
        told = json.loads(text)
    except json.JSONDecodeError:
        return ""
    return str(told.get("state", "")) if isinstance(told, dict) else ""
