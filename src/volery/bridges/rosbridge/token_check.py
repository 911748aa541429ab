"""Checks the token of a client that did not send it in its request for a connection."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from volery.bridges.rosbridge.protocol import RosbridgePeer
from volery.bridges.rosbridge.wire import Frame
from volery.core.token_attempts import TokenAttempts


@dataclass(frozen=True)
class TokenCheck:
    """Checks the frames of one client until it is authorized."""

    attempts: TokenAttempts
    address: str
    wait_closed: Callable[[], Awaitable[None]]
    """Waits for the end of the connection."""
    prove: Callable[[], None]
    """Called once the client is authorized."""

    async def receive(self, peer: RosbridgePeer, frame: Frame) -> None:
        """Passes a frame to the peer, in turn with other clients of the same address."""
        async with self.attempts.turn(self.address):
            peer.receive(frame, time.monotonic())
            if peer.refused is not None:
                await self.attempts.penalize(self.wait_closed)
        if peer.authorized:
            self.prove()
