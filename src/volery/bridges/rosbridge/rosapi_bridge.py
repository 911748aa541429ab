"""Offers rosapi beside bridges whose own protocol cannot tell what there is on the graph."""

from __future__ import annotations

from volery.bridges.rosbridge.rosapi import RosApi
from volery.graph.bridge_kind import Bridge
from volery.graph.session import Gateway


class RosApiBridge:
    """A bridge, and the rosapi services where nobody offers them yet."""

    def __init__(self, bridge: Bridge) -> None:
        self.bridge = bridge
        self._rosapi: RosApi | None = None

    @property
    def name(self) -> str:
        """What the bridge is and where."""
        return self.bridge.name

    async def start(self, gateway: Gateway) -> None:
        """Open the bridge. `BridgeError` where that is not possible."""
        await self.bridge.start(gateway)
        self._rosapi = RosApi(gateway, "ros2", gateway.graph.now_ns)
        self._rosapi.start()

    async def stop(self) -> None:
        """Close the bridge."""
        if self._rosapi is not None:
            self._rosapi.stop()
            self._rosapi = None
        await self.bridge.stop()
