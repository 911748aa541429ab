"""Unity's side of a ROS-TCP connection, run by the simulation; without a socket.

The session registers as publisher of the graph's topics, as subscriber of command topics, and as
server of the graph's services. Received messages are never sent back: a topic has one direction.
`__remove_*` is never sent, since Unity's endpoint closes the connection on it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.calls import Calls
from volery.bridges.ros_tcp.incoming_queue import IncomingQueue
from volery.bridges.ros_tcp.outbox import RosTcpOutbox
from volery.bridges.ros_tcp.payloads import payloads_of
from volery.bridges.ros_tcp.wire import Generation, RosTcpFrame, number_field
from volery.core.errors import BridgeError, GraphError
from volery.graph.session import Gateway
from volery.graph.subscription_queue import Wake
from volery.graph.topics import TopicInfo

_REFUSED = re.compile(r"Not registered to publish topic '([^']+)'")
"""Endpoints' error for each message of an unknown type."""
_UNKNOWN = re.compile(r"Unknown (?:message|service) class '([^']+)'")
"""Endpoints' error for the registration of a type without an installed package."""
_MAX_NAMED = 5
_NOTES = ("__error", "__warn", "__log")


@dataclass(frozen=True)
class Selection:
    """Shared names, as patterns in which `*` matches anything, slashes too."""

    publish: tuple[str, ...] = ("*",)
    """Topics with publishers here that are sent to the endpoint."""
    subscribe: tuple[str, ...] = ("/uav*/cmd_vel", "/uav*/trajectory", "/uav*/goal_pose")
    """Topics with subscribers here that the endpoint may publish; these are not sent."""
    services: tuple[str, ...] = ("*",)
    """Services here that the endpoint may call."""

    def receives(self, topic: TopicInfo) -> bool:
        """Returns whether a topic is received from the endpoint."""
        return topic.subscribers > 0 and _matches(topic.name, self.subscribe)

    def sends(self, topic: TopicInfo) -> bool:
        """Returns whether a topic is sent to the endpoint."""
        return (
            topic.publishers > 0
            and not _matches(topic.name, self.subscribe)
            and _matches(topic.name, self.publish)
        )


class UnitySession:
    """One connection to an endpoint. All methods but the wake belong to the bridge's thread.

    note: called, in any thread, with the endpoint's errors and with what is not sent. begun: called
    once the endpoint's generation is known.
    """

    def __init__(
        self,
        gateway: Gateway,
        name: str,
        selection: Selection,
        depth: int,
        note: Callable[[str], None],
        wake: Wake,
        begun: Callable[[Generation], None] | None = None,
    ) -> None:
        self._selection = selection
        self._depth = depth
        self._note = note
        self._begun = begun
        self._session = gateway.open(name)
        self.outbox = RosTcpOutbox(self._session, payloads_of("ros1"), wake, note)
        self._calls = Calls(self._session, self.outbox, note)
        self._inlets: dict[str, IncomingQueue] = {}
        self._sent: set[str] = set()
        self._served: dict[str, str] = {}
        self._registered: dict[str, list[str]] = {}
        """Topics and services by their types, in the endpoint's spelling."""
        self._unknown: set[str] = set()
        """Types that the endpoint lacks."""
        self._request: int | None = None
        self.generation: Generation | None = None
        """Generation of the endpoint; None before its handshake."""
        self.outbox.put(ros_tcp.KEEPALIVE)

    def begin(self, generation: Generation) -> None:
        """Registers everything, once the generation is known."""
        self.generation = generation
        self.outbox.payloads = payloads_of(generation)
        self.outbox.ends_in_nul = generation == "ros2"  # this endpoint cuts off the last byte
        if self._begun is not None:
            self._begun(generation)
        self.refresh()

    def refresh(self) -> None:
        """Registers new topics and services."""
        if self.generation is None:
            return
        for topic, register in self._new_topics():
            try:
                register(topic)
            except GraphError as error:
                self._note(str(error))
        for name, srvtype in self._session.graph.services().items():
            if self._served.get(name) != srvtype and _matches(name, self._selection.services):
                self._served[name] = srvtype
                self._register("unity_service", name, srvtype)

    def _new_topics(self) -> list[tuple[TopicInfo, Callable[[TopicInfo], None]]]:
        """Returns unregistered topics and their registration functions.

        All their types are learnt before the first one is registered: it is sent from then on, and
        its messages should not wait.
        """
        new: list[tuple[TopicInfo, Callable[[TopicInfo], None]]] = []
        for topic in self._session.graph.topics():
            if topic.name in self._inlets or topic.name in self._sent:
                continue
            receives = self._selection.receives(topic)
            if receives or self._selection.sends(topic):
                try:
                    self.outbox.payloads.learn(topic.msgtype)
                except GraphError as error:
                    self._sent.add(topic.name)
                    self._note(f"'{topic.name}' cannot be sent: {error}")
                else:
                    new.append((topic, self._receive if receives else self._send))
        return new

    def take(self, frame: RosTcpFrame) -> None:
        """Handles a frame. Raises `BridgeError` for an invalid handshake."""
        number, self._request = self._request, None
        if frame.destination == "__handshake":
            if self.generation is None:
                self.begin(ros_tcp.read_handshake(ros_tcp.read_fields(frame.payload)))
            return
        try:
            if frame.destination == "__request":
                self._request = number_field(ros_tcp.read_fields(frame.payload), "srv_id")
            elif frame.destination in _NOTES:
                self._on_problem(str(ros_tcp.read_fields(frame.payload).get("text", "")))
            elif frame.destination.startswith("__"):
                return  # an answer to no request
            elif number is not None:
                self._calls.call(number, frame)
            else:
                self._message(frame)
        except (BridgeError, GraphError) as error:
            self._note(f"{frame.destination[:200]}: {error}")

    def close(self) -> None:
        """Leaves the graph."""
        self._session.close()

    def _on_problem(self, text: str) -> None:
        """Stores the endpoint's message, and stops sending what the endpoint refuses."""
        unknown, refused = _UNKNOWN.search(text), _REFUSED.search(text)
        if unknown is not None and unknown[1] in self._registered:
            self._leave_out(unknown[1])
        elif refused is not None and refused[1] in self._sent:
            if self.outbox.end_stream(refused[1]):
                self._note(f"'{refused[1]}' is no longer sent: {text[:200]}")
        else:
            self._note(text[:1000])

    def _leave_out(self, msgtype: str) -> None:
        """Stops sending a type that the endpoint lacks, and reports its topics and services."""
        if msgtype in self._unknown:
            return
        self._unknown.add(msgtype)
        names = self._registered[msgtype]
        for name in names:
            self.outbox.end_stream(name)
        more = len(names) - _MAX_NAMED
        listed = ", ".join(names[:_MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
        self._note(
            f"the endpoint lacks {msgtype}, which {listed} need: not shared; install "
            f"the package {msgtype.partition('/')[0]} where the endpoint runs"
        )

    def _message(self, frame: RosTcpFrame) -> None:
        inlet = self._inlets.get(frame.destination)
        if inlet is None:
            raise BridgeError("a message on a topic that was not subscribed to")
        inlet.put(self.outbox.payloads.decode(frame.payload, inlet.msgtype))

    def _receive(self, topic: TopicInfo) -> None:
        self._session.advertise(topic.name, topic.msgtype)
        self._inlets[topic.name] = IncomingQueue(
            self._session, topic.name, topic.msgtype, self._depth
        )
        self._register("subscribe", topic.name, topic.msgtype)

    def _send(self, topic: TopicInfo) -> None:
        self._sent.add(topic.name)
        if self._register(
            "publish", topic.name, topic.msgtype, queue_size=self._depth, latch=topic.latched
        ):
            self.outbox.stream(topic.name, topic.name, topic.msgtype, self._depth)

    def _register(self, command: str, name: str, msgtype: str, **fields: str | int) -> bool:
        """Registers a topic or service; returns False if the endpoint is known to lack the type."""
        short = self._short(msgtype)
        if short in self._unknown:
            self._note(f"'{name}' is not shared: the endpoint lacks {short}")
            return False
        self._registered.setdefault(short, []).append(name)
        self._command(command, topic=name, message_name=short, **fields)
        return True

    def _command(self, name: str, **fields: str | int) -> None:
        self.outbox.put(ros_tcp.command(name, nul=self.outbox.ends_in_nul, **fields))

    def _short(self, msgtype: str) -> str:
        return self.outbox.payloads.short(msgtype)


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)
