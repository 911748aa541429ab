"""Outgoing queue of a client: commands first, then messages.

The queue outlives connections; it is empty between two of them.
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
    """Queues frames, for any thread; calls `wake` when there is something to `gather`."""

    def __init__(self, wake: Wake) -> None:
        self.lock = threading.RLock()
        """Held during changes of the client's requests to the endpoint."""
        self.payloads: Payloads = payloads_of("ros1")
        """Encoding of messages on this connection."""
        self.features: frozenset[str] = frozenset()
        """Extensions of the protocol that the endpoint supports."""
        self.open = False
        """Whether the endpoint's generation is known, so that frames can be sent."""
        self.dropped = 0
        """Number of messages without a connection, or over too slow a connection."""
        self._wake = wake
        self._woken = False
        self._nul = False
        self._commands: deque[bytes] = deque()
        self._command_bytes = 0
        self._messages: deque[bytes] = deque()
        self._message_bytes = 0

    def begin(self, generation: Generation, features: frozenset[str]) -> None:
        """Starts a connection with an endpoint of this generation of ROS."""
        with self.lock:
            self.payloads = payloads_of(generation)
            self.features = features
            self._nul = generation == "ros2"  # this endpoint cuts off the last byte
            self.open = True

    def lose(self) -> None:
        """Ends the connection and drops its queue."""
        with self.lock:
            self.open = False
            self.dropped += len(self._messages)
            self._messages.clear()
            self._commands.clear()
            self._message_bytes = self._command_bytes = 0

    def keep_alive(self) -> None:
        """Sends a keepalive."""
        self._put(ros_tcp.KEEPALIVE)

    def command(self, name: str, body: tuple[str, Bytes] | None = None, **fields: Any) -> None:
        """Sends a command, if the connection is ready.

        body: destination and payload of the frame that belongs to it.
        """
        with self.lock:
            if self.open:
                frame = ros_tcp.command(name, nul=self._nul, **fields)
                # in one write: a frame between them would count as the body
                self._put(frame if body is None else frame + ros_tcp.frame(*body))

    def message(self, topic: str, payload: Bytes) -> None:
        """Sends a message; over too slow a network the oldest ones are dropped."""
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
        """Whether so many commands wait that no more should be caused."""
        return self._command_bytes > _MOST_COMMAND_BYTES

    def gather(self) -> list[Bytes]:
        """Returns whole frames to send next, a bounded number; none if nothing waits."""
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
