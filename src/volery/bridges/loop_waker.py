"""Runs callbacks in an asyncio loop at the request of other threads.

The simulation's thread wakes all clients of a bridge when it publishes. Each
`loop.call_soon_threadsafe` costs a system call, in which a busy loop takes the interpreter lock for
a switch interval: 50 wake-ups took 20 ms. So a loop has one waker, and one system call wakes it for
all callbacks that are waiting. A loop that was woken looks again in its next round, until one finds
nothing: a busy loop needs no further system calls.
"""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from weakref import WeakValueDictionary

Callback = Callable[[], object]


class LoopWaker:
    """Queues callbacks for one loop. They run in order; the loop reports their errors."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._wake = loop.call_soon_threadsafe
        self._call_soon = loop.call_soon
        self._report = loop.call_exception_handler
        self._waiting: deque[Callback] = deque()
        self._is_called = False

    def run(self, callback: Callback) -> None:
        """Runs `callback()` in the loop soon; callable from any thread.

        Has no effect after the loop has ended.
        """
        self._waiting.append(callback)
        if self._is_called:  # `_run_waiting` will read the queue
            return
        self._is_called = True
        try:
            self._wake(self._run_waiting)
        except RuntimeError:  # the loop has ended
            self._is_called = False
            self._waiting.clear()

    def _run_waiting(self) -> None:
        count = len(self._waiting)
        if not count:
            self._is_called = False
            if not self._waiting:  # what another thread adds from now on wakes the loop
                return
            self._is_called = True
        self._call_soon(self._run_waiting)
        for _ in range(count):
            callback = self._waiting.popleft()
            try:
                callback()
            except Exception as error:
                self._report({"message": f"{callback} failed", "exception": error})


_wakers: WeakValueDictionary[asyncio.AbstractEventLoop, LoopWaker] = WeakValueDictionary()
_lock = threading.Lock()


def wake_of(loop: asyncio.AbstractEventLoop, callback: Callback) -> Callable[[], None]:
    """Returns a `graph.session.Wake` that runs `callback` in `loop`, if the loop is still open."""
    with _lock:
        waker = _wakers.get(loop)
        if waker is None:
            waker = _wakers[loop] = LoopWaker(loop)
    return lambda: waker.run(callback)
