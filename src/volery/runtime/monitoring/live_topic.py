"""A topic that tells of the present: on a grid of simulated time, and again where that stands.

On the grid it is an ordinary topic, which nodes and recorders may read. In between, while the
simulation is paused, stepped or slow, clients outside are shown what has changed, and whoever is
new is shown how things are. Nothing in the simulation sees these extra messages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from volery.graph.graph import Publisher

Timers = Callable[..., None]
"""`every(period_s, callback, wanted=...)` has something done in simulated time."""


@dataclass
class LiveTopic:
    """Tells what `message()` says each `period_s` of simulated time, and between where it changed.

    `content()` is cheap to make and differs from the last one where the message would. Shown are
    changes that nobody was told for `least_s` of wall time.
    """

    publisher: Publisher
    message: Callable[[], Any]
    content: Callable[[], Any]
    period_s: float
    least_s: float
    _told: Any = None
    _told_at_s: float = 0.0
    _watchers: int = 0
    _now_s: float = 0.0

    def begin(self, every: Timers) -> None:
        """Tell from now on."""
        every(self.period_s, self._tell, wanted=lambda: self.publisher.wanted)

    def look(self, now_s: float) -> None:
        """Show what is new at `now_s` of wall time; between ticks."""
        self._now_s = now_s
        if not self.publisher.watched:
            return
        watchers = self.publisher.watchers_so_far
        if watchers == self._watchers and now_s - self._told_at_s < self.least_s:
            return
        content = self.content()
        if watchers != self._watchers or content != self._told:
            self._watchers, self._told, self._told_at_s = watchers, content, now_s
            self.publisher.show(self.message())

    def _tell(self) -> None:
        self._told_at_s, self._watchers = self._now_s, self.publisher.watchers_so_far
        self._told = self.content() if self.publisher.watched else None
        self.publisher.publish(self.message())
