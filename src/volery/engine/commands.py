"""Commands from other threads: taken in between two ticks, never in the middle of one."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, Protocol


class Moment(NamedTuple):
    """When a command is taken, the same however the run is sliced.

    turn: what has been done since the physics step, counted: ticks, meetings with partners, rounds
    of commands.
    """

    step: int
    turn: int


class Repeats(Protocol):
    """Recorded commands that are taken again at their moments."""

    def next_step(self) -> int | None:
        """Physics step at which the next one is to be taken, None when no more come."""

    def take(self) -> bool:
        """Do what was done at the engine's present moment; whether that was anything."""


class Inbox:
    """What outside clients want done. Any thread may post; the engine's thread works it off.

    Code that runs in the engine's own thread between ticks (nodes, a user's script) commands the
    fleet directly: that too takes effect with the next physics step.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._news = threading.Event()

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called before the next tick; the future holds its result or error."""
        future: Future[Any] = Future()
        self._waiting.append((action, future))
        self._news.set()
        return future

    def wake(self) -> None:
        """End a `wait` although nothing was posted."""
        self._news.set()

    def wait(self, timeout_s: float) -> None:
        """Wait until something is posted after the last wait, or `wake` is called."""
        self._news.wait(timeout_s)
        self._news.clear()

    def work_off(self) -> bool:
        """Call everything that waits, in the order of arrival; whether there was anything."""
        waiting = len(self._waiting)
        for _ in range(waiting):
            action, future = self._waiting.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(action())
            except Exception as error:  # the sender's business, not the engine's
                future.set_exception(error)
        return waiting > 0
