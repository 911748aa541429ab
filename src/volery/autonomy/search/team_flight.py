"""One UAV's flight in a search: its pose, its state messages, its teammates, its commands.

`cooperative_search.CooperativeSearch` decides on top of it.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.settings import SearchSettings
from volery.autonomy.search.steering import is_at, towards
from volery.autonomy.search.teammates import (
    ALOFT,
    GOING_HOME,
    RISING,
    UNDER_WAY,
    SearchPhase,
    Teammate,
)
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import Odometry, Point, Twist, header, message_type
from volery.graph.nodes.node import Node
from volery.graph.nodes.service_client import Client, Future

_PHASES = frozenset(map(str, SearchPhase))
_STILL_UP = frozenset({SearchPhase.CLIMB, SearchPhase.ALOFT})
_PERIOD_S = 0.1
_SETTLE_S = 1.0
"""Time for which the UAV reports that it is ready before it climbs, so that others wait."""
_REPEAT_S = 2.0
"""Period of requests for a take-off or landing that has not begun."""
_CLIMB_S, _CLIMB_S_PER_M = 15.0, 2.0
"""Timeout of a climb: constant, and for each metre."""
_FALLEN_M = 1.0
"""Height over the take-off position below which a flying UAV counts as fallen."""
_LANDED_M, _STILL_M_S = 0.3, 0.2
_ARRIVED_M, _ARRIVED_M_S = 0.5, 0.4
"""All modelling choices."""


class TeamFlight(SavedAttributes, Node):
    """Takes off, flies in its layer, lands where it took off; exchanges `search/state`.

    A UAV leaves the column over its take-off position only when no teammate climbs, and descends
    only when no teammate is under way; in between each flies at a height of its own.
    """

    STATE: ClassVar[tuple[str, ...]] = (
        "phase",
        "pose",
        "teammates",
        "_home",
        "_since_ns",
        "_asked_ns",
    )
    """Names of the attributes that a snapshot stores."""

    def __init__(self, **options: Any) -> None:
        super().__init__("search", **options)
        self.settings = SearchSettings.declare(self)
        self.phase = SearchPhase.READY
        self.pose: OdometrySample | None = None
        self.teammates = {name: Teammate() for name in self.settings.teammates}
        self._home = np.zeros(3)
        self._since_ns: int | None = None
        """Start of the phase, ns."""
        self._asked_ns = -1 << 62

        self._legs = {
            SearchPhase.READY: self._wait_for_team,
            SearchPhase.CLIMB: self._climb,
            SearchPhase.ALOFT: self._wait_aloft,
            SearchPhase.HOME: self._go_home,
            SearchPhase.OVER_HOME: self._wait_aloft,
            SearchPhase.LAND: self._sink,
        }
        self._state_type = message_type("volery_interfaces/msg/SearchState")
        self._command = self.create_publisher(Twist, "cmd_vel", 1)
        self._state = self.create_publisher(self._state_type, "~/state", 1, latched=True)
        self._take_off = self.create_client("volery_interfaces/srv/TakeOffTo", "take_off_to")
        self._land = self.create_client("std_srvs/srv/Trigger", "land")
        self.create_subscription(Odometry, "odom", self._on_odometry, 5)
        for name in self.settings.teammates:
            topic = self._of(name, "state")
            self.create_subscription(self._state_type, topic, self._listener(name), 5)
        self.create_timer(_PERIOD_S, self._on_timer)

    def act(self, pose: OdometrySample) -> None:
        """Runs the phases between climb and landing; a subclass overrides it."""

    # -------------------------------------------------------------------------------- for
    # subclasses

    @property
    def now_ns(self) -> int:
        """Time of the node's clock, ns."""
        return self.get_clock().now_ns()

    @property
    def phase_s(self) -> float:
        """Duration of the current phase so far, s."""
        return 0.0 if self._since_ns is None else (self.now_ns - self._since_ns) * 1e-9

    def enter(self, phase: SearchPhase) -> None:
        """Enters another phase and publishes it."""
        self.phase, self._since_ns = phase, self.now_ns
        self._publish_state()

    def in_layer(self, position: Array) -> Array:
        """Returns the position (3,) over or under `position`, at this UAV's own height."""
        return np.array([position[0], position[1], self.settings.layer_z])

    def fly_to(self, position: Array, within_m: float = _ARRIVED_M) -> bool:
        """Publishes a command towards `position` (3,) m; returns whether the UAV hovers there."""
        assert self.pose is not None
        self._command.publish(towards(self.pose, position, self.settings.speed_m_s))
        return is_at(self.pose, position, within_m, _ARRIVED_M_S)

    def team_in(self, phases: frozenset[SearchPhase]) -> bool:
        """Returns whether a teammate with recent messages is in one of these phases."""
        now, timeout_s = self.now_ns, self.settings.timeout_s
        return any(
            m.phase in phases and m.is_recent(now, timeout_s) for m in self.teammates.values()
        )

    def ask(self, client: Client, request: Any | None = None, then: Any = None) -> None:
        """Calls a service; `then(response)` is called when the response arrives."""

        def on_answer(answer: Future) -> None:
            if then is not None and answer.exception() is None:
                then(answer.result())

        try:
            client.call_async(request).add_done_callback(on_answer)
        except GraphError:
            return  # no server now; the caller repeats the request

    # -------------------------------------------------------------------------------- subscriptions

    def _of(self, uav: str, name: str) -> str:
        """Returns the name of one of a teammate's search topics or services."""
        return f"/{uav}/search/{name}"

    def _on_odometry(self, message: Odometry) -> None:
        self.pose = OdometrySample.from_odometry(message)

    def _listener(self, name: str) -> Any:
        def on_state(message: Any) -> None:
            mate = self.teammates[name]
            if message.phase not in _PHASES:
                return  # a phase of a newer version
            mate.phase = SearchPhase(message.phase)
            p = message.position
            mate.position, mate.received_ns = np.array([p.x, p.y, p.z]), self.now_ns

        return on_state

    def _publish_state(self) -> None:
        position = np.zeros(3) if self.pose is None else self.pose.position
        self._state.publish(
            self._state_type(header(self.now_ns, "map"), str(self.phase), Point(*position.tolist()))
        )

    # ------------------------------------------------------------------------------------ behaviour

    def _on_timer(self) -> None:
        pose = self.pose
        if pose is None:
            return
        if self._since_ns is None:
            self._home = pose.position.copy()
            self.enter(SearchPhase.READY)
        elif self._since_ns > self.now_ns:  # wall clock, before the graph's
            self._since_ns = self.now_ns
        if self.phase in ALOFT and pose.position[2] < self._home[2] + _FALLEN_M:
            self._give_up()
        on_a_leg = self._legs.get(self.phase)
        if on_a_leg is not None:
            on_a_leg(pose)
        self.act(pose)
        self._publish_state()

    def _go_home(self, _pose: OdometrySample) -> None:
        if self.fly_to(self.in_layer(self._home)):
            self.enter(SearchPhase.OVER_HOME)

    def _wait_aloft(self, _pose: OdometrySample) -> None:
        self.fly_to(self.in_layer(self._home))
        if self.phase is SearchPhase.ALOFT and not self.team_in(RISING):
            self.enter(SearchPhase.SEARCH)
        elif self.phase is SearchPhase.OVER_HOME and not self.team_in(UNDER_WAY | _STILL_UP):
            self.enter(SearchPhase.LAND)

    def _wait_for_team(self, _pose: OdometrySample) -> None:
        if any(m.phase in UNDER_WAY | GOING_HOME for m in self.teammates.values()):
            self.enter(SearchPhase.LATE)
            return
        is_team_complete = all(m.phase is not None for m in self.teammates.values())
        if self.phase_s >= _SETTLE_S and (
            is_team_complete or self.phase_s >= self.settings.gather_s
        ):
            self.enter(SearchPhase.CLIMB)

    def _climb(self, pose: OdometrySample) -> None:
        height = self.settings.layer_z - self._home[2]
        at_rest = abs(pose.velocity[2]) < _STILL_M_S
        if at_rest and abs(self.settings.layer_z - pose.position[2]) < _ARRIVED_M:
            self.enter(SearchPhase.ALOFT)
        elif self.phase_s > _CLIMB_S + _CLIMB_S_PER_M * height:
            self._give_up()
        elif pose.position[2] < self._home[2] + _LANDED_M and self._may_ask():
            request = message_type("volery_interfaces/srv/TakeOffTo_Request")
            self.ask(self._take_off, request(float(height)))

    def _sink(self, pose: OdometrySample) -> None:
        if pose.position[2] < self._home[2] + _LANDED_M and (norm(pose.velocity) < _STILL_M_S):
            self.enter(SearchPhase.DONE)
        elif self._may_ask():
            self.ask(self._land)

    def _give_up(self) -> None:
        """Leaves the search; lands if the UAV still flies."""
        self.enter(SearchPhase.DOWN)
        self.ask(self._land)

    def _may_ask(self) -> bool:
        """Returns whether the last request is older than `_REPEAT_S`."""
        if 0 <= self.now_ns - self._asked_ns <= _REPEAT_S * NS_PER_S:
            return False
        self._asked_ns = self.now_ns
        return True
