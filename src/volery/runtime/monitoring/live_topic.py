"""Publishes a state on a grid of simulated time, and to external clients also in between.

On the grid the topic is an ordinary one, for nodes and recorders. In between, while the simulation
is paused, stepped or slow, external clients receive changes, and new clients the present state.
Nothing in the simulation receives these extra messages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from volery.graph.topics import Publisher

Timers = Callable[..., None]
"""`every(period_s, callback, has_subscribers=...)` schedules a callback in simulated time."""


@dataclass
class LiveTopic:
    """Publishes `message()` each `period_s` of simulated time, and in between on changes.

    `content()` is cheap and differs from the last one if the message would. External clients
    receive changes after at least `min_period_s` of wall time without a message.
    """

    publisher: Publisher
    message: Callable[[], Any]
    content: Callable[[], Any]
    period_s: float
    min_period_s: float
    _last_content: Any = None
    _published_at_s: float = 0.0
    _num_subscribers: int = 0
    _now_s: float = 0.0

    def begin(self, every: Timers) -> None:
        """Starts publishing."""
        every(self.period_s, self._publish, wanted=lambda: self.publisher.has_subscribers)

    def look(self, now_s: float) -> None:
        """Publishes changes to external clients at wall time `now_s`; call it between ticks."""
        self._now_s = now_s
        if not self.publisher.has_external_subscribers:
            return
        num_subscribers = self.publisher.num_external_subscriptions
        if (
            num_subscribers == self._num_subscribers
            and now_s - self._published_at_s < self.min_period_s
        ):
            return
        content = self.content()
        if num_subscribers != self._num_subscribers or content != self._last_content:
            self._num_subscribers, self._last_content, self._published_at_s = (
                num_subscribers,
                content,
                now_s,
            )
            self.publisher.publish_external(self.message())

    def _publish(self) -> None:
        self._published_at_s, self._num_subscribers = (
            self._now_s,
            self.publisher.num_external_subscriptions,
        )
        self._last_content = self.content() if self.publisher.has_external_subscribers else None
        self.publisher.publish(self.message())
