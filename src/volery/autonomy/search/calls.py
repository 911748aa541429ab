"""Claims to a find, and the calls of teammates to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.core.clock import NS_PER_S
from volery.graph.messages import Point, message_type, time_from_ns

JOIN = "volery_interfaces/srv/JoinSearch"
"""Type of the service by which a teammate is called."""
_PERIOD_NS, _MOST = NS_PER_S, 20
"""How often, and how many times, a teammate is called. Modelling choice."""


class RescueClaim(NamedTuple):
    """Who has found something, when and where. The least one counts: earlier, then by name."""

    stamp_ns: int
    finder: str
    place: tuple[float, float, float]

    @property
    def key(self) -> tuple[int, str]:
        """What claims are told apart by, and put in order."""
        return self.stamp_ns, self.finder

    def request(self) -> Any:
        """The request to come."""
        return message_type(f"{JOIN}_Request")(
            time_from_ns(self.stamp_ns), self.finder, Point(*self.place)
        )

    @classmethod
    def from_request(cls, request: Any) -> RescueClaim:
        """What a request says."""
        stamp_ns = request.stamp.sec * NS_PER_S + request.stamp.nanosec
        place = request.place.x, request.place.y, request.place.z
        return cls(stamp_ns, request.finder, place)


@dataclass
class RescueCall:
    """A teammate that is called. Times are ns of the node's clock."""

    tries: int = 0
    asked_ns: int = 0
    accepted: bool = False

    def note(self, response: Any) -> None:
        """Take in an answer."""
        self.accepted = self.accepted or bool(response.accepted)


@dataclass
class RescueCalls:
    """The calls for an own find; none for one of another UAV."""

    to: dict[str, RescueCall] = field(default_factory=dict)

    @classmethod
    def of(cls, names: Iterable[str]) -> RescueCalls:
        """New ones."""
        return cls({name: RescueCall() for name in names})

    def begin_due(self, now_ns: int) -> list[tuple[str, RescueCall]]:
        """Those to call now (again); they count as called from here on."""
        due = [
            (name, call)
            for name, call in self.to.items()
            if call.tries < _MOST and not call.accepted and self._has_waited(call, now_ns)
        ]
        for _, call in due:
            call.tries, call.asked_ns = call.tries + 1, now_ns
        return due

    def are_settled(self, now_ns: int) -> bool:
        """Whether everybody comes, or has been given up."""
        return all(
            call.accepted or (call.tries >= _MOST and self._has_waited(call, now_ns))
            for call in self.to.values()
        )

    def drop(self, name: str) -> None:
        """Call one of them no more."""
        self.to.pop(name, None)

    def _has_waited(self, call: RescueCall, now_ns: int) -> bool:
        return call.tries == 0 or now_ns - call.asked_ns >= _PERIOD_NS
