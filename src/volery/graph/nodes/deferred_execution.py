"""Runs a node's callbacks on a worker and delays their output by a declared latency.

A callback receives its input at simulated time t; its publications and requests are released at t +
latency. The engine continues meanwhile, and waits for the worker only at t + latency: a heavy node
uses another core, has the delay of a real computer, and the run stays reproducible. Callbacks of
one node run one after the other, in the order of their input; inputs do not wait for earlier
outputs.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, Protocol

from volery.core.errors import GraphError

Action = Callable[[], Any]


class Deferred(Protocol):
    """Runs functions at simulated times."""

    def at(self, time_ns: int, action: Action) -> None:
        """Calls `action` once, at `time_ns`."""


@dataclass
class _CallbackGroup:
    """The callbacks of one instant: time of their input, their work and their delayed output."""

    time_ns: int
    work: list[Action] = field(default_factory=list)
    output: list[Action] = field(default_factory=list)
    batch: _Batch | None = None
    """Batch that contains the callbacks; None before they are handed over."""
    error: BaseException | None = None


class _Batch:
    """Callbacks that the worker receives together."""

    def __init__(self, groups: list[_CallbackGroup]) -> None:
        self.groups = groups
        self._busy = threading.Lock()
        self._busy.acquire()
        for group in groups:
            group.batch = self

    def finish(self) -> None:
        """Wakes the threads that wait for the batch."""
        self._busy.release()

    def wait(self) -> None:
        """Waits until the batch is done."""
        with self._busy:
            return


class DeferredExecutor:
    """The worker of one node. All methods but `now_ns` and `defer` are called by the engine.

    Waking a thread takes longer than most callbacks, so callbacks are handed over in batches: when
    the oldest has waited a third of the latency, or with a callback marked as heavy.
    """

    def __init__(
        self, name: str, latency_ns: int, deferring: Deferred, now_ns: Callable[[], int]
    ) -> None:
        self._latency_ns = latency_ns
        self._deferring = deferring
        self._engine_now_ns = now_ns
        self._waiting: list[_CallbackGroup] = []
        """Not yet handed over, in order of time."""
        self._inbox: SimpleQueue[_Batch | None] = SimpleQueue()
        self._running: _CallbackGroup | None = None
        """Callbacks that the worker is running."""
        self._last: _Batch | None = None
        self._closed = False
        self.busy_s = 0.0
        """CPU time of the worker so far, s."""
        self._thread = threading.Thread(target=self._run, name=f"volery-{name}", daemon=True)
        self._thread.start()

    def submit(self, work: Action, *, heavy: bool = False) -> None:
        """Runs `work()` on the worker; its output is released after the latency."""
        if self._closed:
            return
        now = self._engine_now_ns()
        if not self._waiting or self._waiting[-1].time_ns != now:
            group = _CallbackGroup(now)
            self._waiting.append(group)
            self._deferring.at(now + self._latency_ns, partial(self._release, group))
        self._waiting[-1].work.append(work)
        if heavy or 3 * (now - self._waiting[0].time_ns) >= self._latency_ns:
            self._hand_over()

    def call(self, work: Action) -> Any:
        """Runs `work()` after all earlier work, waits for it and returns its result."""
        result: list[Any] = []
        self.submit(lambda: result.append(work()), heavy=True)
        batch = self._last
        if batch is None or self._closed:
            raise GraphError("the node has been destroyed")
        batch.wait()
        if not result:
            raise batch.groups[-1].error or GraphError("the node has been destroyed")
        return result[0]

    def now_ns(self) -> int:
        """Returns the input's time on the worker, the engine's time on other threads, ns."""
        group = self._current_group()
        return self._engine_now_ns() if group is None else group.time_ns

    def defer(self, action: Action) -> bool:
        """Delays `action` to the release of the running callback; returns False without one."""
        group = self._current_group()
        if group is None:
            return False
        group.output.append(action)
        return True

    def join(self) -> None:
        """Hands over all work and waits for it; has no effect on the worker itself."""
        if self._current_group() is not None:
            return
        self._hand_over()
        if self._last is not None:
            self._last.wait()

    def close(self) -> None:
        """Ends the worker; callbacks that have not started are dropped."""
        self._closed = True
        self._inbox.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _hand_over(self) -> None:
        if self._waiting and not self._closed:
            self._last = _Batch(self._waiting)
            self._waiting = []
            self._inbox.put(self._last)

    def _release(self, group: _CallbackGroup) -> None:
        """Releases the output of the callbacks whose latency has passed; waits for them."""
        if self._closed:
            return
        if group.batch is None:
            self._hand_over()
        assert group.batch is not None
        group.batch.wait()
        if group.error is not None:
            raise group.error
        for action in group.output:
            action()

    def _current_group(self) -> _CallbackGroup | None:
        return self._running if threading.get_ident() == self._thread.ident else None

    def _run(self) -> None:
        while (batch := self._inbox.get()) is not None:
            for group in batch.groups:
                self._running = group
                try:
                    self._work(group)
                finally:
                    self._running = None
            batch.finish()

    def _work(self, group: _CallbackGroup) -> None:
        before = time.thread_time()
        try:
            while group.work and not self._closed:
                group.work.pop(0)()
        except BaseException as error:  # raised by the engine at the release
            group.error = error
        finally:
            self.busy_s += time.thread_time() - before
