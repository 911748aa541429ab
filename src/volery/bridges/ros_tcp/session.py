"""Protocol of one client of Volery's ROS-TCP endpoint, without a socket.

The client receives each of its errors as `__error`; other clients are not affected. A service that
fails, or that has no server, is answered with `__error`, and with the empty response of `calls`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.calls import Calls
from volery.bridges.ros_tcp.incoming_queue import IncomingQueue
from volery.bridges.ros_tcp.outbox import RosTcpOutbox
from volery.bridges.ros_tcp.payloads import (
    absolute,
    payloads_of,
    service_type,
    topic_type,
)
from volery.bridges.ros_tcp.wire import Generation, RosTcpFrame, number_field, text_field
from volery.core.errors import BridgeError, GraphError
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.read_budget import ReadScope
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway
from volery.graph.subscription_queue import Wake

MAX_DEPTH = 1000
MAX_REGISTRATIONS = 10_000
"""Topics and services of one client."""
_FIRST_REQUEST = 1001
"""First request number, as in ROS-TCP-Endpoint."""

FEATURES = (ros_tcp.QUEUE_SIZE, ros_tcp.REMOVE, ros_tcp.RESPONSE_ERROR)

Fields = dict[str, Any]
Body = Callable[[RosTcpFrame], None]


class EndpointSession:
    """One client's session of the graph. `take` and `close` belong to the bridge's thread."""

    def __init__(
        self,
        gateway: Gateway,
        name: str,
        generation: Generation,
        depth: int,
        wake: Wake,
    ) -> None:
        self._payloads = payloads_of(generation, limited=True)
        self._session = gateway.open(name)
        self._depth = depth
        self.outbox = RosTcpOutbox(self._session, self._payloads, wake, self.complain)
        self._inlets: dict[str, IncomingQueue] = {}
        self._called: dict[str, str] = {}
        self._offered: set[str] = set()
        self._requests = _Requests()
        self._session.on_refused = self.complain
        self._calls = Calls(self._session, self.outbox, self.complain)
        self._body: tuple[str, int, Body] | None = None
        self._commands: dict[str, Callable[[Fields], None]] = {
            "__publish": self._publish,
            "__subscribe": self._subscribe,
            "__ros_service": self._ros_service,
            "__unity_service": self._unity_service,
            "__request": self._request,
            "__response": self._response,
            "__topic_list": self._topic_list,
            "__remove_publisher": self._remove_publisher,
            "__remove_subscriber": self._remove_subscriber,
            "__remove_ros_service": self._remove_ros_service,
            "__remove_unity_service": self._remove_unity_service,
        }

    @property
    def reading(self) -> ReadScope:
        """Account of reading from the client, which limits its rate."""
        return self._session.reading

    def take(self, frame: RosTcpFrame) -> None:
        """Handles a frame."""
        body, self._body = self._body, None
        try:
            if frame.destination.startswith("__"):
                if body is not None:
                    self._lack_body(*body[:2])
                self._command(frame)
            elif body is not None:
                body[2](frame)
            else:
                self._message(frame)
        except (BridgeError, GraphError) as error:
            self.complain(f"{frame.destination[:200]}: {error}")

    def complain(self, text: str) -> None:
        """Sends an error to the client; any thread may call it."""
        self.outbox.put(ros_tcp.command("error", text=text))

    def close(self) -> None:
        """Releases everything that the client registered."""
        self._session.close()

    # ------------------------------------------------------------------------------------ topics

    def _command(self, frame: RosTcpFrame) -> None:
        action = self._commands.get(frame.destination)
        if action is None:
            raise BridgeError(f"no such command; known: {', '.join(self._commands)}")
        action(ros_tcp.read_fields(frame.payload))

    def _publish(self, fields: Fields) -> None:
        name, msgtype = _name_in(fields), topic_type(text_field(fields, "message_name"))
        depth = _depth(fields, DEFAULT_DEPTH)
        topic = absolute(name)
        self._check_room(self._inlets, name)
        self._session.advertise(topic, msgtype, latched=bool(fields.get("latch", False)))
        self._payloads.learn(msgtype)
        self._inlets[name] = IncomingQueue(self._session, topic, msgtype, depth)

    def _remove_publisher(self, fields: Fields) -> None:
        inlet = self._inlets.pop(text_field(fields, "topic"), None)
        if inlet is None:
            raise BridgeError(f"'{fields['topic']}' was not published")
        if all(other.topic != inlet.topic for other in self._inlets.values()):
            self._session.unadvertise(inlet.topic)

    def _message(self, frame: RosTcpFrame) -> None:
        inlet = self._inlets.get(frame.destination)
        if inlet is None:
            raise BridgeError(f"Not registered to publish topic '{frame.destination[:200]}'")
        inlet.put(self._payloads.decode(frame.payload, inlet.msgtype))

    def _subscribe(self, fields: Fields) -> None:
        name, msgtype = _name_in(fields), topic_type(text_field(fields, "message_name"))
        if self.outbox.streams >= MAX_REGISTRATIONS:
            raise BridgeError(f"over {MAX_REGISTRATIONS} topics")
        depth = _depth(fields, self._depth)
        reliable = fields.get("queue_size") == 0
        self.outbox.stream(name, absolute(name), msgtype, depth, reliable=reliable)

    def _remove_subscriber(self, fields: Fields) -> None:
        if not self.outbox.end_stream(text_field(fields, "topic")):
            raise BridgeError(f"'{fields['topic']}' was not subscribed to")

    def _topic_list(self, _fields: Fields) -> None:
        topics = self._session.graph.topics()
        names, types = [t.name for t in topics], [self._payloads.short(t.msgtype) for t in topics]
        self.outbox.put(ros_tcp.command("topic_list", topics=names, types=types))

    # ------------------------------------------------------------ services that the client calls

    def _ros_service(self, fields: Fields) -> None:
        name, srvtype = _name_in(fields), service_type(text_field(fields, "message_name"))
        self._check_room(self._called, name)
        self._called[name] = srvtype

    def _remove_ros_service(self, fields: Fields) -> None:
        if self._called.pop(text_field(fields, "topic"), None) is None:
            raise BridgeError(f"service '{fields['topic']}' was not registered")

    def _request(self, fields: Fields) -> None:
        number = number_field(fields, "srv_id")
        self._body = ("request", number, lambda frame: self._call(number, frame))

    def _call(self, number: int, frame: RosTcpFrame) -> None:
        self._calls.call(number, frame, self._called.get(frame.destination))

    def _lack_body(self, what: str, number: int) -> None:
        """Handles a missing body, which Unity's queues may drop behind its header."""
        self.complain(f"__{what} {number} came without its body")
        if what == "request":
            self._calls.respond(number, "/", b"")

    # ----------------------------------------------------------- services that the client offers

    def _unity_service(self, fields: Fields) -> None:
        name, srvtype = _name_in(fields), service_type(text_field(fields, "message_name"))
        self._check_room(self._offered, name)
        service = absolute(name)
        if name in self._offered:
            self._offered.discard(name)
            self._session.destroy_service(service)

        def ask(request: Any, reply: ServiceReply) -> None:
            if self.outbox.crowded:
                reply.fail(GraphError(f"service '{service}': its server does not read"))
                return
            body = self._payloads.encode(request, f"{srvtype}_Request")
            number = self._requests.add(reply, srvtype)
            header = ros_tcp.command("request", srv_id=number)
            self.outbox.put(header + ros_tcp.frame(name, body))

        self._session.create_service(service, srvtype, ask)
        self._offered.add(name)

    def _remove_unity_service(self, fields: Fields) -> None:
        name = text_field(fields, "topic")
        if name not in self._offered:
            raise BridgeError(f"service '{name}' does not exist")
        self._offered.discard(name)
        self._session.destroy_service(absolute(name))

    def _response(self, fields: Fields) -> None:
        number, error = number_field(fields, "srv_id"), fields.get("error")
        self._body = ("response", number, lambda frame: self._answer(number, frame, error))

    def _answer(self, number: int, frame: RosTcpFrame, error: Any) -> None:
        """Passes the client's response to the caller of its service."""
        reply, srvtype = self._requests.pop(number)
        if error is not None:
            reply.fail(GraphError(str(error)))
            return
        try:
            response = self._payloads.decode(frame.payload, f"{srvtype}_Response")
        except GraphError as broken:
            reply.fail(GraphError(f"the service's response is invalid: {broken}"))
            raise
        reply.answer(response)

    def _check_room(self, registered: dict[str, Any] | set[str], name: str) -> None:
        if name not in registered and len(registered) >= MAX_REGISTRATIONS:
            raise BridgeError(f"over {MAX_REGISTRATIONS} registrations")


def _depth(fields: Fields, default: int) -> int:
    """Returns the depth of a client's `queue_size`; in ROS a queue of 0 loses nothing."""
    depth = number_field({"queue_size": default, **fields}, "queue_size")
    return min(max(depth, 1), MAX_DEPTH) if depth else MAX_DEPTH


def _name_in(fields: Fields) -> str:
    """Returns the name of the topic or service to register."""
    name = text_field(fields, "topic")
    if name.startswith("__"):
        raise BridgeError(f"'{name[:200]}' is reserved for commands")
    return name


class _Requests:
    """Requests that the client has not answered yet; the simulation's thread adds to them."""

    def __init__(self) -> None:
        self._open: dict[int, tuple[ServiceReply, str]] = {}
        self._next = _FIRST_REQUEST
        self._lock = threading.Lock()

    def add(self, reply: ServiceReply, srvtype: str) -> int:
        with self._lock:
            number, self._next = self._next, self._next + 1
            self._open[number] = (reply, srvtype)
        reply.when_done(lambda: self._forget(number))
        return number

    def _forget(self, number: int) -> None:
        self._open.pop(number, None)

    def pop(self, number: int) -> tuple[ServiceReply, str]:
        with self._lock:
            found = self._open.pop(number, None)
        if found is None:
            raise BridgeError(f"no request {number} is open")
        return found
