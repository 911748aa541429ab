"""Doors: servers and clients that carry the graph to other programs, on one asyncio thread.

    with Doors(simulation.gateway) as doors:
        doors.open(RosTcpEndpoint(port=10000))
        simulation.run(speed=1.0)

Everything a door does runs in the thread of `Doors`; what it needs of the simulation it asks of the
`Gateway`. A door that fails ends alone.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from volery.bridges.loop_thread import LoopThread
from volery.core.errors import BridgeError
from volery.graph.bridge_kind import Bridge
from volery.graph.session import Gateway

T = TypeVar("T")
_log = logging.getLogger(__name__)

_LONGEST_START_S = 30.0


class Doors:
    """The thread in which doors work. Use it as a context manager, or call `close`."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._doors: list[Bridge] = []
        self._thread = LoopThread("volery-doors")
        self._closed = False
        self._thread.start()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the open doors."""
        return tuple(door.name for door in self._doors)

    def open(self, door: Bridge) -> None:
        """Start a door; `BridgeError` where that is not possible."""
        if self._closed:
            raise BridgeError("the doors are closed")
        try:
            self.call(door.start(self._gateway), _LONGEST_START_S)
        except BaseException:
            self.call(door.stop(), _LONGEST_START_S)
            raise
        self._doors.append(door)

    def call(self, work: Coroutine[Any, Any, T], timeout_s: float | None = None) -> T:
        """Run a coroutine in the doors' thread and wait for its result."""
        return self._thread.call(work, timeout_s)

    def close(self) -> None:
        """Stop all doors and the thread; a second time nothing happens."""
        if self._closed:
            return
        self._closed = True
        for door in reversed(self._doors):
            try:
                self.call(door.stop(), _LONGEST_START_S)
            except Exception:
                _log.exception("%s did not close in good order", door.name)
        self._thread.end()

    def __enter__(self) -> Doors:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()


def wake_of(loop: asyncio.AbstractEventLoop, callback: Callable[[], object]) -> Callable[[], None]:
    """A `graph.session.Wake` that has `callback` called in `loop`, also while that is closing."""

    def wake() -> None:
        try:
            loop.call_soon_threadsafe(callback)
        except RuntimeError:  # the loop has ended: nobody is left to be told
            return

    return wake
