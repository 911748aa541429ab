"""Offers rosapi beside doors whose own protocol cannot tell what there is on the graph."""

from __future__ import annotations

from volery.bridges.rosbridge.rosapi import RosApi
from volery.graph.bridge_kind import Bridge
from volery.graph.session import Gateway


class WithRosApi:
    """A door, and the rosapi services where nobody offers them yet."""

    def __init__(self, door: Bridge) -> None:
        self.door = door
        self._rosapi: RosApi | None = None

    @property
    def name(self) -> str:
        """What the door is and where."""
        return self.door.name

    async def start(self, gateway: Gateway) -> None:
        """Open the door. `BridgeError` where that is not possible."""
        await self.door.start(gateway)
        self._rosapi = RosApi(gateway, "ros2", gateway.graph.now_ns)
        self._rosapi.start()

    async def stop(self) -> None:
        """Close the door."""
        if self._rosapi is not None:
            self._rosapi.stop()
            self._rosapi = None
        await self.door.stop()
