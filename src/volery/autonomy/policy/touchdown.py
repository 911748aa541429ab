"""Ends a policy's flight at the touchdown, for tasks that land."""

from __future__ import annotations

from typing import Any, ClassVar

from volery.core.saved_state import SavedAttributes
from volery.graph.messages import message_type
from volery.graph.nodes.node import Node


class Touchdown(SavedAttributes):
    """Watches `flight_state`; once the UAV was in the air and is down, calls the service `land`."""

    STATE: ClassVar[tuple[str, ...]] = ("is_down", "_was_airborne", "_is_airborne")

    def __init__(self, node: Node) -> None:
        self.is_down = False
        """Whether the UAV has touched down while the policy flew."""
        self._was_airborne = self._is_airborne = False
        self._land = node.create_client("std_srvs/srv/Trigger", "land")
        state = message_type("volery_interfaces/msg/FlightState")
        node.create_subscription(state, "flight_state", self._on_state, 5)

    def check(self, is_flying: bool) -> bool:
        """Returns `is_down`; at the touchdown of a flying policy, calls `land` once.

        A UAV that takes off again may be flown again.
        """
        if self.is_down and self._is_airborne:
            self.is_down = False
        elif is_flying and self._was_airborne and not self._is_airborne and not self.is_down:
            self.is_down, self._was_airborne = True, False
            if self._land.service_is_ready():
                self._land.call_async()
        return self.is_down

    def _on_state(self, message: Any) -> None:
        self._is_airborne = bool(message.airborne)
        self._was_airborne |= self._is_airborne
