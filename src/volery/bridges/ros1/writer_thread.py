"""The thread that writes to ROS 1 subscribers, each of which may be slow or stand still.

rospy has a thread and an unlimited wait for each of them; here one thread writes what their sockets
take at once, and keeps a bounded rest for each.
"""

from __future__ import annotations

import logging
import os
import select
import selectors
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

_MOST_MESSAGES = 1000
_MOST_BYTES = 16 << 20
"""What may wait for one subscriber; beyond, the oldest goes."""
_LENGTH = struct.Struct("<I")

_log = logging.getLogger(__name__)


class Served(Protocol):
    """What a pump serves."""

    topic: str

    def serve(self) -> None:
        """Send what there is to send; called in the pump's thread."""


class Reader:
    """One ROS 1 subscriber of one topic, for the pump's thread alone."""

    def __init__(self, connection: Any, selector: selectors.BaseSelector) -> None:
        self.dropped = 0
        self._connection = connection
        self._selector = selector
        # The duplicate stays valid, and ours, when rospy closes the connection meanwhile.
        self._socket = socket.socket(fileno=os.dup(connection.fileno()))
        self._socket.setblocking(False)
        if self._socket.family in (socket.AF_INET, socket.AF_INET6):
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._waiting: deque[memoryview] = deque()
        self._waiting_bytes = 0

    def send(self, data: bytes) -> None:
        """Send one message, now or as soon as the subscriber takes it."""
        length = _LENGTH.pack(len(data))
        if self._waiting:
            self._keep(memoryview(length + data))
            return
        try:
            sent = self._socket.sendmsg((length, data))
        except BlockingIOError:
            sent = 0
        except OSError:
            self._give_up()
            return
        if sent == len(data) + _LENGTH.size:
            return
        whole = sent < _LENGTH.size
        rest = (
            memoryview(length + data)[sent:] if whole else memoryview(data)[sent - _LENGTH.size :]
        )
        self._keep(rest)
        self._selector.register(self._socket, selectors.EVENT_WRITE, self)

    def flush(self) -> None:
        """Send on what waits."""
        while self._waiting:
            first = self._waiting[0]
            try:
                sent = self._socket.send(first)
            except BlockingIOError:
                return
            except OSError:
                self._give_up()
                return
            self._waiting_bytes -= sent
            if sent < len(first):
                self._waiting[0] = first[sent:]
                return
            self._waiting.popleft()
        self._selector.unregister(self._socket)

    def close(self) -> None:
        """Send no more; nothing happens a second time."""
        if self._waiting and self._selector.get_map() is not None:  # None once the pump has ended
            self._selector.unregister(self._socket)
        self._waiting.clear()
        self._socket.close()

    def _keep(self, rest: memoryview) -> None:
        self._waiting.append(rest)
        self._waiting_bytes += len(rest)
        # The first one is on its way in part; the last one is the newest.
        while len(self._waiting) > 2 and (
            len(self._waiting) > _MOST_MESSAGES or self._waiting_bytes > _MOST_BYTES
        ):
            self._waiting_bytes -= len(self._waiting[1])
            del self._waiting[1]
            self.dropped += 1

    def _give_up(self) -> None:
        """The subscriber has gone; rospy strikes it off and tells the topic so."""
        self.close()
        self._connection.close()


class Ros1WriterThread:
    """Serves topics in its own thread: neither the simulation nor other bridges wait."""

    def __init__(self) -> None:
        self._selector = selectors.EpollSelector()
        self._ready: deque[Served] = deque()
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll = select.epoll()
        # Edge-triggered: each ring is told of once, without a read, which would let go of the GIL.
        self._poll.register(self._bell, select.EPOLLIN | select.EPOLLET)
        self._poll.register(self._selector.fileno(), select.EPOLLIN)
        self._lock = threading.Lock()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="volery-ros1", daemon=True)
        self._thread.start()

    def reader(self, connection: Any) -> Reader:
        """What writes to a connection of rospy's; for use in `serve`."""
        return Reader(connection, self._selector)

    def waker(self, served: Served) -> Callable[[], None]:
        """A function that has something served, to be called by any thread."""

        def wake() -> None:
            self._ready.append(served)
            self._ring()

        return wake

    def close(self) -> None:
        """End the thread; what waits is not sent."""
        self._closing = True
        self._ring()
        self._thread.join()
        self._poll.close()
        self._selector.close()
        with self._lock:
            os.close(self._bell)
            self._bell = -1

    def _ring(self) -> None:
        with self._lock:
            if self._bell >= 0:
                os.eventfd_write(self._bell, 1)

    def _run(self) -> None:
        while not self._closing:
            for number, _ in self._poll.poll():
                if number != self._bell:
                    for key, _ in self._selector.select(0):
                        key.data.flush()
            while self._ready and not self._closing:
                self._serve(self._ready.popleft())

    def _serve(self, served: Served) -> None:
        try:
            served.serve()
        except Exception as error:  # one topic's trouble must not end the others
            _log.warning("ROS 1 topic %s: %s: %s", served.topic, type(error).__name__, error)
