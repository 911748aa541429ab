"""Bridges: servers and clients that connect the graph to other programs, on one asyncio thread.

    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(RosTcpEndpoint(port=10000))
        simulation.run(speed=1.0)

All code of a bridge runs in the thread of `BridgeHost` and accesses the simulation through the
`Gateway`. A bridge that fails does not affect the others.
"""

from __future__ import annotations

import logging
from collections.abc import Coroutine
from typing import Any, TypeVar

from volery.bridges.loop_thread import LoopThread
from volery.core.errors import BridgeError
from volery.graph.bridge_kind import Bridge
from volery.graph.session import Gateway

T = TypeVar("T")
_log = logging.getLogger(__name__)

_LONGEST_START_S = 30.0


class BridgeHost:
    """The thread in which bridges run. Use it as a context manager, or call `close`."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._bridges: list[Bridge] = []
        self._thread = LoopThread("volery-bridges")
        self._closed = False
        self._thread.start()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the open bridges."""
        return tuple(bridge.name for bridge in self._bridges)

    def open(self, bridge: Bridge) -> None:
        """Starts a bridge. Raises `BridgeError` if that fails."""
        if self._closed:
            raise BridgeError("the bridges are closed")
        try:
            self.call(bridge.start(self._gateway), _LONGEST_START_S)
        except BaseException:
            self.call(bridge.stop(), _LONGEST_START_S)
            raise
        self._bridges.append(bridge)

    def call(self, work: Coroutine[Any, Any, T], timeout_s: float | None = None) -> T:
        """Runs a coroutine in the bridges' thread and waits for its result."""
        return self._thread.call(work, timeout_s)

    def close(self) -> None:
        """Stops all bridges and the thread; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        for bridge in reversed(self._bridges):
            try:
                self.call(bridge.stop(), _LONGEST_START_S)
            except Exception:
                _log.exception("%s did not close cleanly", bridge.name)
        self._thread.end()

    def __enter__(self) -> BridgeHost:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()
