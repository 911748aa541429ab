"""Cooperative search: each UAV searches for a colour at random and calls the others to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.calls import JOIN, RescueCalls, RescueClaim
from volery.autonomy.search.ground_view import Intrinsics
from volery.autonomy.search.object_detection import object_position
from volery.autonomy.search.search_positions import check_room, positions_around, random_waypoint
from volery.autonomy.search.steering import is_at
from volery.autonomy.search.team_flight import TeamFlight
from volery.autonomy.search.teammates import CAN_COME, GOING_HOME, ON_THE_WAY, RISING, SearchPhase
from volery.core import rng
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.vectors import norm
from volery.graph.messages import (
    CameraInfo,
    Image,
    Point,
    PointStamped,
    header,
    stamp_of,
)

_BORDER_M = 1.0
"""Distance of waypoints to the border of the area: more than a UAV's tracking error."""
_NEAR_M = 1.0
"""Distance to a waypoint at which the next one begins."""
_LOOKS, _LOOK_S = 5, 8.0
"""Images from above at rest that confirm a detection, and the time for them, without the
approach.
"""
_REST_M_S = 0.3
_BLIND_S = 2.0
"""Time without an image after which the UAV stops."""
_SEARCHING = frozenset({SearchPhase.SEARCH, SearchPhase.LOOK})
"""All modelling choices."""


class CooperativeSearch(TeamFlight):
    """Searches its area by its own camera; calls teammates, and is called, by `search/join`.

    Parameters
    ----------
    team: names of all UAVs of the search, this one included. The order counts: each flies a layer
        higher than the previous one.
    area_m: [x_min, y_min, x_max, y_max] in the map; limits the flight and the detections.
    altitude_m, layer_spacing_m: z of the lowest UAV, and the height difference between UAVs.
    speed_m_s: horizontal speed.
    separation_m: min horizontal distance between UAVs at the object, and to it.
    camera: its topics are `CAMERA/image_raw` and `CAMERA/camera_info`.
    mount_m, mount_rpy_deg: of the camera in the body, as in a scenario.
    object_height_m: z of the object's centre.
    hue_deg: [first, last]; min_saturation, min_value: minimums; see `search.colour_blob`.
    min_fraction: min fraction of the image.
    gather_s: time to wait on the ground for teammates that have not reported yet.
    timeout_s: timeout of a teammate's reports.
    hold_s: time that all stay at the object.
    max_search_s: time limit of the search; 0: none.
    seed: of the waypoints; each UAV has a stream of its own.

    """

    STATE = (
        *TeamFlight.STATE,
        "claim",
        "calls",
        "_intrinsics",
        "_waypoint",
        "_began_ns",
        "_image_ns",
        "_look_from",
        "_look_s",
        "_looks",
        "_waiting_ns",
        "_finishing",
        "_pending_calls",
    )

    WARMUP_TASKS = ("volery.autonomy.search.warmup:colours",)

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        settings = self.settings
        self._inner = settings.area.without_border(_BORDER_M)
        self._key = rng.stream_key(settings.seed, f"{settings.name}/search")
        check_room(*self._spread)

        self.claim: RescueClaim | None = None
        """Current claim, by this UAV or another one."""
        self.calls = RescueCalls()
        """Calls for an own detection."""
        self._intrinsics: Intrinsics | None = None
        self._waypoint = 0
        self._began_ns: int | None = None
        """Start of the search, ns."""
        self._image_ns = 0
        self._look_from = np.zeros(3)
        self._look_s = 0.0
        self._looks: list[Array] = []
        self._waiting_ns: int | None = None
        """Time since which all called teammates have arrived, ns."""
        self._finishing = False
        self._pending_calls: list[str] = []
        """Teammates that have not been notified yet of the end of the search."""

        self._found = self.create_publisher(PointStamped, "~/found", 1, latched=True)
        self._come_clients = {n: self.create_client(JOIN, self._of(n, "join")) for n in self.mates}
        self._finish_clients = {
            n: self.create_client("std_srvs/srv/Trigger", self._of(n, "finish")) for n in self.mates
        }
        self.create_service(JOIN, "~/join", self.on_call)
        self.create_service("std_srvs/srv/Trigger", "~/finish", self._on_finish)
        self.create_subscription(Image, f"{settings.camera}/image_raw", self._on_image, 1)
        self._listen_for_intrinsics()

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        super().set_state(state)
        if self._intrinsics is None:
            self._listen_for_intrinsics()

    @property
    def mates(self) -> tuple[str, ...]:
        """Names of the teammates."""
        return self.settings.teammates

    # -------------------------------------------------------------------------------- perception

    def _listen_for_intrinsics(self) -> None:
        """Subscribes until the first message, as a subscription makes a camera render depth too."""

        def on_info(info: CameraInfo) -> None:
            self._intrinsics = Intrinsics.from_message(info)
            listening.cancel()

        topic = f"{self.settings.camera}/camera_info"
        listening = self.create_subscription(CameraInfo, topic, on_info, 1)

    def _on_image(self, image: Image) -> None:
        self._image_ns = self.now_ns
        if self.phase not in _SEARCHING or self.pose is None or self._intrinsics is None:
            return
        mates = [m.position for m in self.teammates.values() if m.phase is not None]
        position = object_position(image, self._intrinsics, self.settings, self.pose, mates)
        if position is None:
            return
        if self.phase is SearchPhase.SEARCH:
            self._see(stamp_of(image), position)
        elif is_at(self.pose, self._look_from, _NEAR_M, _REST_M_S):
            self._looks.append(position)

    def _see(self, stamp_ns: int, position: Array) -> None:
        """Interrupts the search and looks again from above, where height errors matter little."""
        assert self.pose is not None
        self.claim = RescueClaim(stamp_ns, self.settings.name, _plain(position))
        low, high = np.reshape(self._inner, (2, 2))
        self._look_from, self._looks = self.in_layer(np.clip(position[:2], low, high)), []
        distance = norm(self._look_from - self.pose.position)
        self._look_s = _LOOK_S + distance / self.settings.speed_m_s
        self.enter(SearchPhase.LOOK)

    # ----------------------------------------------------------------------------------- behaviour

    def act(self, pose: OdometrySample) -> None:
        """Runs the phases search, look, come and hold."""
        if self.phase in CAN_COME - {SearchPhase.READY} and self.team_in(GOING_HOME):
            self._finish()
        if self._finishing and self.phase in CAN_COME - RISING:
            self.enter(SearchPhase.HOME)
        if self.phase is SearchPhase.SEARCH:
            self._search(pose)
        elif self.phase is SearchPhase.LOOK:
            self._look()
        elif self.phase in (SearchPhase.COME, SearchPhase.HOLD):
            arrived = self.fly_to(self._own_search_position())
            if arrived and self.phase is SearchPhase.COME:
                self.enter(SearchPhase.HOLD)
            self._call_teammates()
            if self.phase is SearchPhase.HOLD:
                self._hold()
        for name in self._pending_calls:
            self.ask(self._finish_clients[name])
        self._pending_calls = []

    def _search(self, pose: OdometrySample) -> None:
        if self.claim is not None:  # called during the climb
            self.enter(SearchPhase.COME)
            return
        if self._began_ns is None:
            self._began_ns = self.now_ns
        if 0.0 < self.settings.max_search_s * NS_PER_S < self.now_ns - self._began_ns:
            self._finish()
            return
        if not 0 <= self.now_ns - self._image_ns <= _BLIND_S * NS_PER_S:
            self.fly_to(pose.position)
            return
        goal = self.in_layer(random_waypoint(self._inner, self._key, self._waypoint))
        self.fly_to(goal)
        if norm(goal[:2] - pose.position[:2]) < _NEAR_M:
            self._waypoint += 1

    def _look(self) -> None:
        assert self.claim is not None
        self.fly_to(self._look_from)
        if len(self._looks) >= _LOOKS:
            position = np.median(self._looks, axis=0)
            self.claim = self.claim._replace(position=_plain(position))
            self.calls = RescueCalls.of(self.mates)
            stamp = header(self.claim.stamp_ns, "map")
            self._found.publish(PointStamped(stamp, Point(*self.claim.position)))
            self._begin_to_come()
        elif self.phase_s > self._look_s:
            self.claim = None
            self.enter(SearchPhase.SEARCH)

    def _begin_to_come(self) -> None:
        self._waiting_ns = None
        self.enter(SearchPhase.COME)

    @property
    def _spread(self) -> tuple[int, float, Any]:
        return len(self.settings.team), self.settings.separation_m, self._inner

    def _own_search_position(self) -> Array:
        assert self.claim is not None
        positions = positions_around(np.array(self.claim.position), *self._spread)
        return self.in_layer(positions[self.settings.rank])

    def _hold(self) -> None:
        """Ends the search once all called teammates have stayed for `hold_s`.

        The finder decides; the others follow its phase.
        """
        assert self.claim is not None
        finder = self.teammates.get(self.claim.finder)
        timeout_s = self.settings.timeout_s
        if finder is not None and finder.is_recent(self.now_ns, timeout_s):
            waits = finder.phase in CAN_COME
        else:
            waits = self.team_in(ON_THE_WAY) or not self.calls.are_settled(self.now_ns)
        if waits:
            self._waiting_ns = None
        elif self._waiting_ns is None:
            self._waiting_ns = self.now_ns
        elif self.now_ns - self._waiting_ns > self.settings.hold_s * NS_PER_S:
            self._finish()

    # ----------------------------------------------------------------------------------- agreement

    def _call_teammates(self) -> None:
        assert self.claim is not None
        for name in self.mates:
            phase = self.teammates[name].phase
            if phase is not None and phase not in CAN_COME:
                self.calls.drop(name)
        for name, call in self.calls.begin_due(self.now_ns):
            self.ask(self._come_clients[name], self.claim.request(), call.note)

    def on_call(self, request: Any, response: Any) -> Any:
        """Handles a teammate's call: the earliest detection counts, then the first name."""
        response.message = self._why_not(RescueClaim.from_request(request))
        response.accepted = not response.message
        return response

    def _why_not(self, called: RescueClaim) -> str:
        """Accepts a call and returns "", or returns the reason for the refusal."""
        name = self.settings.name
        if called.finder not in self.mates:
            return f"{called.finder or 'the caller'} is not in the team of {name}"
        if not self.settings.area.holds(*called.position[:2]):
            return f"{name} does not leave its area"
        if self.phase not in CAN_COME or self._finishing:
            return f"{name} no longer takes part: {self.phase}"
        if self.claim is not None and self.claim.key < called.key:
            return f"{self.claim.finder} has an earlier detection"
        if self.claim is None or self.claim.key != called.key:
            self.claim, self.calls = called, RescueCalls()
            if self.phase in CAN_COME - RISING - {SearchPhase.ALOFT}:
                self._begin_to_come()
        return ""

    def _on_finish(self, _request: Any, response: Any) -> Any:
        self._finish()
        response.success, response.message = True, str(self.phase)
        return response

    def _finish(self) -> None:
        """Flies home, or stays on the ground, and notifies the teammates once."""
        if not self._finishing:
            self._finishing, self._pending_calls = True, list(self.mates)
            if self.phase is SearchPhase.READY:
                self.enter(SearchPhase.DONE)


def _plain(position: Array) -> tuple[float, float, float]:
    x, y, z = map(float, position)
    return x, y, z
