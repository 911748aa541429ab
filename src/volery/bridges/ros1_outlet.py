"""Topics of the graph on their way to ROS 1 subscribers."""

from __future__ import annotations

import logging
import os
import queue
import socket
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Any

from volery.bridges.ros1_node import Ros1Node
from volery.bridges.ros1_raw import raw_message_class
from volery.core.errors import GraphError
from volery.graph.messages import Published
from volery.graph.ros1 import ros1_codec
from volery.graph.session import Mailbox, Session

_DEPTH = 1000
"""One tick may publish once for each UAV, as it does on `/tf`."""
_OWN_KEPT = 1000

_log = logging.getLogger(__name__)
_Send = Callable[[Any], None]


class Outlet:
    """One topic: its messages are taken and turned into bytes only while somebody subscribes.

    `serve` runs in the pump's thread; all else may be called by any.
    """

    def __init__(
        self, node: Ros1Node, session: Session, topic: str, msgtype: str, *, latched: bool
    ) -> None:
        self.topic = topic
        self.msgtype = msgtype
        self.latched = latched
        self._session = session
        self._encode = ros1_codec().encode
        self._raw = raw_message_class(msgtype)
        self._mailbox: Mailbox | None = None
        self._newcomers: queue.SimpleQueue[_Send] = queue.SimpleQueue()
        self._own: OrderedDict[int, Any] = OrderedDict()
        self._sequence = 0
        self._complained = False
        self._wake: Callable[[], None] = _nothing
        self._publisher = node.publisher(topic, msgtype, latched=latched, listener=self)

    def start(self, wake: Callable[[], None]) -> None:
        """Have `serve` called by `wake`."""
        self._wake = wake
        wake()

    @property
    def connected(self) -> bool:
        """Whether anybody subscribes."""
        return bool(self._publisher.get_num_connections())

    @property
    def holds(self) -> Mailbox | None:
        """The mailbox, while somebody subscribes."""
        return self._mailbox

    def on_come(self, send: _Send) -> None:
        """Somebody subscribes; `send` publishes to nobody else."""
        self._newcomers.put(send)
        self._wake()

    def on_gone(self) -> None:
        """Somebody has left."""
        self._wake()

    def leave_out(self, message: Any) -> None:
        """Do not send a message that came from ROS 1 itself."""
        if self._mailbox is not None:
            self._own[id(message)] = message
            if len(self._own) > _OWN_KEPT:
                self._own.popitem(last=False)

    def serve(self) -> None:
        """Send what waits; begin or end to listen to the graph as subscribers come and go."""
        newcomers = list(_drain(self._newcomers))
        if not self.connected:
            self._let_go()
            return
        if newcomers or self._mailbox is None:
            _send_at_once(self._publisher.impl.connections)
        if self._mailbox is None:
            self._mailbox = self._subscribe()  # it holds what was latched, for all
            newcomers = []
        kept = self._kept() if self.latched and newcomers else []
        fresh = self._mailbox.take()
        known = {id(published) for published in fresh}
        for published in kept:
            if id(published) not in known:
                self._send(published, newcomers)
        for published in fresh:
            if self._own.pop(id(published.message), None) is None:
                self._send(published, [self._publisher.publish])

    def close(self) -> None:
        """Publish no more, once the pump has ended."""
        self._let_go()
        self._publisher.unregister()

    def _subscribe(self) -> Mailbox:
        return self._session.subscribe(self.topic, self.msgtype, depth=_DEPTH, wake=self._wake)

    def _kept(self) -> list[Published]:
        """What latched publishers of the graph have sent last."""
        glance = self._session.subscribe(self.topic, self.msgtype, depth=_DEPTH, wake=_nothing)
        self._session.unsubscribe(glance)
        return glance.take()

    def _send(self, published: Published, targets: Iterable[_Send]) -> None:
        try:
            data = self._encode(published.message, self.msgtype, self._sequence)
        except GraphError as error:
            self._complain(error)
            return
        self._sequence += 1
        for send in targets:
            send(self._raw(data))

    def _complain(self, error: Exception) -> None:
        """Say once what cannot be sent."""
        if not self._complained:
            self._complained = True
            _log.warning("ROS 1 topic %s: %s", self.topic, error)

    def _let_go(self) -> None:
        if self._mailbox is not None:
            self._session.unsubscribe(self._mailbox)
            self._mailbox = None
            self._own.clear()


class Pump:
    """The thread in which outlets send, so that neither the simulation nor other doors wait."""

    def __init__(self) -> None:
        self._ready: queue.SimpleQueue[Outlet | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="volery-ros1", daemon=True)
        self._thread.start()

    def add(self, outlet: Outlet) -> None:
        """Serve an outlet from now on."""
        outlet.start(lambda: self._ready.put(outlet))

    def wake(self, outlet: Outlet) -> None:
        """Serve an outlet once more."""
        self._ready.put(outlet)

    def close(self) -> None:
        """End the thread; what waits is not sent."""
        self._ready.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (outlet := self._ready.get()) is not None:
            try:
                outlet.serve()
            except Exception as error:  # one topic's trouble must not end the others
                _log.warning("ROS 1 topic %s: %s: %s", outlet.topic, type(error).__name__, error)


def _send_at_once(connections: Iterable[Any]) -> None:
    """Switch Nagle's algorithm off, which rospy does only for subscribers that ask for it."""
    for connection in connections:
        number = connection.fileno()
        if number is None:
            continue
        try:
            with socket.socket(fileno=os.dup(number)) as same:
                same.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError:  # it is closing
            continue


def _drain(source: queue.SimpleQueue[_Send]) -> Iterable[_Send]:
    while not source.empty():
        yield source.get_nowait()


def _nothing() -> None:
    """Nobody needs to be woken."""
