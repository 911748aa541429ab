"""Adds rosapi to bridges whose own protocol cannot list the contents of the graph."""

from __future__ import annotations

from volery.bridges.rosbridge.rosapi import RosApi
from volery.graph.bridge_kind import Bridge
from volery.graph.session import Gateway


class RosApiBridge:
    """A bridge with the rosapi services, unless they exist already."""

    def __init__(self, bridge: Bridge) -> None:
        self.bridge = bridge
        self._rosapi: RosApi | None = None

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return self.bridge.name

    async def start(self, gateway: Gateway) -> None:
        """Opens the bridge. Raises `BridgeError` if that fails."""
        await self.bridge.start(gateway)
        self._rosapi = RosApi(gateway, "ros2", gateway.graph.now_ns)
        self._rosapi.start()

    async def stop(self) -> None:
        """Closes the bridge."""
        if self._rosapi is not None:
            self._rosapi.stop()
            self._rosapi = None
        await self.bridge.stop()
