"""Claims to a detection, and the calls of teammates to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.core.clock import NS_PER_S
from volery.graph.messages import Point, message_type, time_from_ns

JOIN = "volery_interfaces/srv/JoinSearch"
"""Type of the service that calls a teammate."""
_PERIOD_NS, _MAX_TRIES = NS_PER_S, 20
"""Period and max number of calls to a teammate. Modelling choice."""


class RescueClaim(NamedTuple):
    """Finder, time and position of a detection. Claims order by time, then by name."""

    stamp_ns: int
    finder: str
    position: tuple[float, float, float]

    @property
    def key(self) -> tuple[int, str]:
        """Returns the key that identifies and orders claims."""
        return self.stamp_ns, self.finder

    def request(self) -> Any:
        """Returns the service request that calls a teammate."""
        return message_type(f"{JOIN}_Request")(
            time_from_ns(self.stamp_ns), self.finder, Point(*self.position)
        )

    @classmethod
    def from_request(cls, request: Any) -> RescueClaim:
        """Returns the claim of a request."""
        stamp_ns = request.stamp.sec * NS_PER_S + request.stamp.nanosec
        position = request.place.x, request.place.y, request.place.z
        return cls(stamp_ns, request.finder, position)


@dataclass
class RescueCall:
    """State of the call to one teammate. Times are ns of the node's clock."""

    tries: int = 0
    asked_ns: int = 0
    accepted: bool = False

    def note(self, response: Any) -> None:
        """Processes a response."""
        self.accepted = self.accepted or bool(response.accepted)


@dataclass
class RescueCalls:
    """Calls for an own detection; empty for another UAV's."""

    to: dict[str, RescueCall] = field(default_factory=dict)

    @classmethod
    def of(cls, names: Iterable[str]) -> RescueCalls:
        """Returns new calls to UAVs."""
        return cls({name: RescueCall() for name in names})

    def begin_due(self, now_ns: int) -> list[tuple[str, RescueCall]]:
        """Returns the calls that are due, and marks them as sent."""
        due = [
            (name, call)
            for name, call in self.to.items()
            if call.tries < _MAX_TRIES and not call.accepted and self._has_waited(call, now_ns)
        ]
        for _, call in due:
            call.tries, call.asked_ns = call.tries + 1, now_ns
        return due

    def are_settled(self, now_ns: int) -> bool:
        """Returns whether all teammates have accepted or have been given up."""
        return all(
            call.accepted or (call.tries >= _MAX_TRIES and self._has_waited(call, now_ns))
            for call in self.to.values()
        )

    def drop(self, name: str) -> None:
        """Stops calling a teammate."""
        self.to.pop(name, None)

    def _has_waited(self, call: RescueCall, now_ns: int) -> bool:
        return call.tries == 0 or now_ns - call.asked_ns >= _PERIOD_NS
