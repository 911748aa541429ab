"""The part that Unity plays in a ROS-TCP connection, played by the simulation; without a socket.

It registers itself as publisher of the graph's topics, as subscriber of those by which it is
commanded, and as server of the graph's services. What is received is never sent back: a topic goes
one way. `__remove_*` is never sent, since Unity's endpoint closes the connection on it.
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
from volery.graph.graph import TopicInfo
from volery.graph.session import Gateway
from volery.graph.subscription_queue import Wake

_REFUSED = re.compile(r"Not registered to publish topic '([^']+)'")
"""What endpoints say to each message whose type they do not know."""
_UNKNOWN = re.compile(r"Unknown (?:message|service) class '([^']+)'")
"""What they say to the registration of a type of which they have no package."""
_MOST_NAMED = 5
_NOTES = ("__error", "__warn", "__log")


@dataclass(frozen=True)
class Selection:
    """What takes part, as patterns in which `*` stands for anything, slashes too."""

    publish: tuple[str, ...] = ("*",)
    """Topics with publishers here that the other side shall get."""
    subscribe: tuple[str, ...] = ("/uav*/cmd_vel", "/uav*/trajectory", "/uav*/goal_pose")
    """Topics with subscribers here that the other side may publish; these are not sent."""
    services: tuple[str, ...] = ("*",)
    """Services here that the other side may call."""

    def receives(self, topic: TopicInfo) -> bool:
        """Whether a topic comes from the other side."""
        return topic.subscribers > 0 and _matches(topic.name, self.subscribe)

    def sends(self, topic: TopicInfo) -> bool:
        """Whether a topic goes to the other side."""
        return (
            topic.publishers > 0
            and not _matches(topic.name, self.subscribe)
            and _matches(topic.name, self.publish)
        )


class UnitySession:
    """One connection to an endpoint. All but the wake belongs to the bridge's thread.

    note: called, by any thread, with what the other side complains of and with what is not sent.
    begun: called once it is known which messages the endpoint speaks.
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
        """Topics and services by their types, as the endpoint spells those."""
        self._unknown: set[str] = set()
        """Types that the endpoint does not know."""
        self._request: int | None = None
        self.generation: Generation | None = None
        """What the endpoint speaks; None before its handshake."""
        self.outbox.put(ros_tcp.KEEPALIVE)

    def begin(self, generation: Generation) -> None:
        """Register everything, now that the generation is known."""
        self.generation = generation
        self.outbox.payloads = payloads_of(generation)
        self.outbox.ends_in_nul = generation == "ros2"  # that endpoint cuts off the last byte
        if self._begun is not None:
            self._begun(generation)
        self.refresh()

    def refresh(self) -> None:
        """Register topics and services that are new."""
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
        """Topics not registered yet, and what does that.

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
        """Do what a frame asks for. `BridgeError` for a handshake that cannot be understood."""
        number, self._request = self._request, None
        if frame.destination == "__handshake":
            if self.generation is None:
                self.begin(ros_tcp.read_handshake(ros_tcp.read_fields(frame.payload)))
            return
        try:
            if frame.destination == "__request":
                self._request = number_field(ros_tcp.read_fields(frame.payload), "srv_id")
            elif frame.destination in _NOTES:
                self._hear(str(ros_tcp.read_fields(frame.payload).get("text", "")))
            elif frame.destination.startswith("__"):
                return  # an answer that was not asked for
            elif number is not None:
                self._calls.call(number, frame)
            else:
                self._message(frame)
        except (BridgeError, GraphError) as error:
            self._note(f"{frame.destination[:200]}: {error}")

    def close(self) -> None:
        """Leave the graph."""
        self._session.close()

    def _hear(self, text: str) -> None:
        """Keep what the endpoint says, and send no more of what it cannot take."""
        unknown, refused = _UNKNOWN.search(text), _REFUSED.search(text)
        if unknown is not None and unknown[1] in self._registered:
            self._leave_out(unknown[1])
        elif refused is not None and refused[1] in self._sent:
            if self.outbox.end_stream(refused[1]):
                self._note(f"'{refused[1]}' is not sent any more: {text[:200]}")
        else:
            self._note(text[:1000])

    def _leave_out(self, msgtype: str) -> None:
        """Send nothing of a type that the endpoint does not know, and say what that concerns."""
        if msgtype in self._unknown:
            return
        self._unknown.add(msgtype)
        names = self._registered[msgtype]
        for name in names:
            self.outbox.end_stream(name)
        more = len(names) - _MOST_NAMED
        listed = ", ".join(names[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
        self._note(
            f"the endpoint does not know {msgtype}, which {listed} need: not shared; install "
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
        """Tell the endpoint of a topic or service; false where it is known not to have the type."""
        short = self._short(msgtype)
        if short in self._unknown:
            self._note(f"'{name}' is not shared: the endpoint does not know {short}")
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
