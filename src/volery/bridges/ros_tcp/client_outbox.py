"""What a client has for the endpoint that it is connected to: commands first, then messages.

It outlives connections; between two of them nothing is kept.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.payloads import Payloads, payloads_of
from volery.bridges.ros_tcp.wire import Bytes, Generation
from volery.graph.subscription_queue import Wake

MOST_WAITING = 1000
"""Messages that may wait for the network."""
MOST_WAITING_BYTES = 64 << 20
_MOST_COMMAND_BYTES = 1 << 20
_BATCH_BYTES = 64 << 10
_BATCH_PARTS = 128


class ClientOutbox:
    """The way out, for any thread; `wake` tells that there is something to `gather`."""

    def __init__(self, wake: Wake) -> None:
        self.lock = threading.RLock()
        """Held by whoever changes what the client wants of the endpoint."""
        self.payloads: Payloads = payloads_of("ros1")
        """How messages become bytes on this connection."""
        self.features: frozenset[str] = frozenset()
        """What the endpoint understands beyond the protocol."""
        self.open = False
        """Whether the endpoint's generation is known, so that it can be spoken to."""
        self.dropped = 0
        """Messages that found no connection, or too slow a one."""
        self._wake = wake
        self._woken = False
        self._nul = False
        self._commands: deque[bytes] = deque()
        self._command_bytes = 0
        self._messages: deque[bytes] = deque()
        self._message_bytes = 0

    def begin(self, generation: Generation, features: frozenset[str]) -> None:
        """The endpoint speaks this generation of ROS."""
        with self.lock:
            self.payloads = payloads_of(generation)
            self.features = features
            self._nul = generation == "ros2"  # that endpoint cuts off the last byte
            self.open = True

    def lose(self) -> None:
        """The connection is gone, and what waited for it."""
        with self.lock:
            self.open = False
            self.dropped += len(self._messages)
            self._messages.clear()
            self._commands.clear()
            self._message_bytes = self._command_bytes = 0

    def keep_alive(self) -> None:
        """Show that the client lives."""
        self._put(ros_tcp.KEEPALIVE)

    def command(self, name: str, body: tuple[str, Bytes] | None = None, **fields: Any) -> None:
        """Send a command, if the endpoint can be spoken to.

        body: destination and payload of the frame that belongs to it.
        """
        with self.lock:
            if self.open:
                frame = ros_tcp.command(name, nul=self._nul, **fields)
                # in one write: what came between them would be taken for the body
                self._put(frame if body is None else frame + ros_tcp.frame(*body))

    def message(self, topic: str, payload: Bytes) -> None:
        """Send a message; of what the network is too slow for, the oldest are dropped."""
        frame = ros_tcp.frame(topic, payload)
        with self.lock:
            self._messages.append(frame)
            self._message_bytes += len(frame)
            while len(self._messages) > MOST_WAITING or self._message_bytes > MOST_WAITING_BYTES:
                self._message_bytes -= len(self._messages.popleft())
                self.dropped += 1
        self._stir()

    @property
    def crowded(self) -> bool:
        """Whether so many commands wait that nothing should be done to cause more."""
        return self._command_bytes > _MOST_COMMAND_BYTES

    def gather(self) -> list[Bytes]:
        """Whole frames to send next, a bounded number; none if nothing waits."""
        self._woken = False
        parts: list[Bytes] = []
        size = 0
        with self.lock:
            while size < _BATCH_BYTES and len(parts) < _BATCH_PARTS:
                if self._commands:
                    frame = self._commands.popleft()
                    self._command_bytes -= len(frame)
                elif self._messages:
                    frame = self._messages.popleft()
                    self._message_bytes -= len(frame)
                else:
                    break
                parts.append(frame)
                size += len(frame)
        return parts

    def _put(self, frame: bytes) -> None:
        with self.lock:
            self._commands.append(frame)
            self._command_bytes += len(frame)
        self._stir()

    def _stir(self) -> None:
        if not self._woken:
            self._woken = True
            self._wake()
