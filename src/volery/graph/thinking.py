"""Time to think: a node's callbacks on a worker, their output held back by a declared latency.

A callback's input is taken at simulated time t; what it publishes and asks for is released at
t + latency. Meanwhile the engine runs on, and waits for the worker only when t + latency has come:
a heavy node uses another core, its delay is that of a real computer, and the run stays as
reproducible as without. Callbacks of one node run one after the other, in the order of their input;
inputs do not wait for earlier outputs.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Protocol

from volery.graph.graph import Publisher

Action = Callable[[], Any]


class Deferring(Protocol):
    """Whoever can do something at a simulated time."""

    def at(self, time_ns: int, action: Action) -> None:
        """Call `action` once, at `time_ns`."""


@dataclass
class _Thought:
    """One callback: when its input was taken, and what it wants done when its time is up."""

    time_ns: int
    output: list[Action] = field(default_factory=list)


class Thinker:
    """The worker of one node. All methods but `now_ns` and `hold_back` belong to the engine."""

    def __init__(
        self, name: str, latency_ns: int, deferring: Deferring, now_ns: Callable[[], int]
    ) -> None:
        self._latency_ns = latency_ns
        self._deferring = deferring
        self._engine_now_ns = now_ns
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"volery-{name}")
        self._here = threading.local()

    def think(self, work: Action) -> Future[Any]:
        """Begin `work()` now; its output is released after the latency."""
        thought = _Thought(self._engine_now_ns())
        future = self._pool.submit(self._work, thought, work)

        def release() -> None:
            future.result()
            for action in thought.output:
                action()

        self._deferring.at(thought.time_ns + self._latency_ns, release)
        return future

    def now_ns(self) -> int:
        """Time of the input that is being worked on; in the engine's thread, the engine's time."""
        thought = self._thought()
        return self._engine_now_ns() if thought is None else thought.time_ns

    def hold_back(self, action: Action) -> bool:
        """Keep `action` for the release of the callback that runs here; False if none does."""
        thought = self._thought()
        if thought is None:
            return False
        thought.output.append(action)
        return True

    def join(self) -> None:
        """Wait until everything begun has been worked on."""
        self._pool.submit(_nothing).result()

    def close(self) -> None:
        """End the worker."""
        self._pool.shutdown(cancel_futures=True)

    def _thought(self) -> _Thought | None:
        return getattr(self._here, "thought", None)

    def _work(self, thought: _Thought, work: Action) -> Any:
        self._here.thought = thought
        try:
            return work()
        finally:
            self._here.thought = None


class DelayedPublisher(Publisher):
    """Publisher of a node with a latency: a callback's messages leave when its time is up."""

    def __init__(self, publisher: Publisher, thinker: Thinker) -> None:
        self._publisher = publisher
        self._thinker = thinker

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._publisher.topic

    @property
    def wanted(self) -> bool:
        """Whether anybody would receive a message."""
        return self._publisher.wanted

    def publish(self, message: Any) -> None:
        """Publish `message` after the latency; outside of callbacks at once."""
        if not self._thinker.hold_back(lambda: self._publisher.publish(message)):
            self._publisher.publish(message)


def _nothing() -> None:
    """Do nothing."""
