"""The thread that writes to ROS 1 subscribers, any of which may be slow or stalled.

rospy has a thread and an unlimited queue for each subscriber; here one thread writes what their
sockets accept at once, and queues a bounded rest for each.
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

_MAX_MESSAGES = 1000
_MAX_BYTES = 16 << 20
"""Limits of what may wait for one subscriber; beyond, the oldest message is dropped."""
_LENGTH = struct.Struct("<I")

_log = logging.getLogger(__name__)


class Served(Protocol):
    """Object that the writer thread serves."""

    topic: str

    def serve(self) -> None:
        """Sends pending messages; called in the writer's thread."""


class Reader:
    """One ROS 1 subscriber of one topic, for the writer's thread alone."""

    def __init__(self, connection: Any, selector: selectors.BaseSelector) -> None:
        self.dropped = 0
        self._connection = connection
        self._selector = selector
        # The duplicate stays valid, and ours, if rospy closes the connection meanwhile.
        self._socket = socket.socket(fileno=os.dup(connection.fileno()))
        self._socket.setblocking(False)
        if self._socket.family in (socket.AF_INET, socket.AF_INET6):
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._waiting: deque[memoryview] = deque()
        self._waiting_bytes = 0

    def send(self, data: bytes) -> None:
        """Sends one message, now or as soon as the subscriber accepts it."""
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
        """Sends pending bytes."""
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
        """Stops sending; further calls do nothing."""
        if (
            self._waiting and self._selector.get_map() is not None
        ):  # None after the writer thread has ended
            self._selector.unregister(self._socket)
        self._waiting.clear()
        self._socket.close()

    def _keep(self, rest: memoryview) -> None:
        self._waiting.append(rest)
        self._waiting_bytes += len(rest)
        # The first message is partly sent; the last one is the newest.
        while len(self._waiting) > 2 and (
            len(self._waiting) > _MAX_MESSAGES or self._waiting_bytes > _MAX_BYTES
        ):
            self._waiting_bytes -= len(self._waiting[1])
            del self._waiting[1]
            self.dropped += 1

    def _give_up(self) -> None:
        """Closes the connection of a subscriber that has gone.

        Rospy removes it and notifies the topic.
        """
        self.close()
        self._connection.close()


class Ros1WriterThread:
    """Serves topics in its own thread: neither the simulation nor other bridges wait."""

    def __init__(self) -> None:
        self._selector = selectors.EpollSelector()
        self._ready: deque[Served] = deque()
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll = select.epoll()
        # Edge-triggered: each ring is reported once, without a read, which would release the GIL.
        self._poll.register(self._bell, select.EPOLLIN | select.EPOLLET)
        self._poll.register(self._selector.fileno(), select.EPOLLIN)
        self._lock = threading.Lock()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="volery-ros1", daemon=True)
        self._thread.start()

    def reader(self, connection: Any) -> Reader:
        """Returns a writer to a connection of rospy's; for use in `serve`."""
        return Reader(connection, self._selector)

    def waker(self, served: Served) -> Callable[[], None]:
        """Returns a function that makes the thread serve an object; any thread may call it."""

        def wake() -> None:
            self._ready.append(served)
            self._ring()

        return wake

    def close(self) -> None:
        """Ends the thread; pending messages are not sent."""
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
        except Exception as error:  # an error of one topic must not end the others
            _log.warning("ROS 1 topic %s: %s: %s", served.topic, type(error).__name__, error)
