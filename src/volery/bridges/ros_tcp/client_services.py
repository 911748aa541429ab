"""Services that one client of a ROS-TCP endpoint calls and offers.

The protocol has no failure: an endpoint sends `__error`, and Volery's then responds with zero
bytes. The caller of a service receives the text of an `__error` about it.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import Any

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.client_outbox import ClientOutbox
from volery.bridges.ros_tcp.payloads import absolute
from volery.bridges.ros_tcp.wire import RosTcpFrame
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import known
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler

FIRST_REQUEST = 101
"""First request number, as in Unity's Connector."""
_OF_SERVICE = re.compile(r"[Ss]ervice (?:destination )?'([^']+)'(?:: )?(.*)", re.DOTALL)
"""Form of error texts about a service: Volery's, and Unity's."""
_TYPE_OF = "/rosapi/service_type"


@dataclass
class _Call:
    service: str
    srvtype: str
    reply: ServiceReply
    why: str = ""
    """Endpoint's error about the service meanwhile."""


@dataclass(frozen=True)
class _Offer:
    srvtype: str
    handler: Handler
    pending: set[ServiceReply] = field(default_factory=set)


class ClientServices:
    """Open calls and offered services, also without a connection."""

    def __init__(self, line: ClientOutbox) -> None:
        self._line = line
        self._calls: dict[int, _Call] = {}
        self._numbers = itertools.count(FIRST_REQUEST)
        self._registered: set[tuple[str, str]] = set()
        self._offers: dict[str, _Offer] = {}
        self._connection = 0

    def repeat(self) -> None:
        """Registers all services on a new connection."""
        self._connection += 1
        self._registered.clear()
        for service, offer in self._offers.items():
            self._announce(service, offer.srvtype)

    def lose(self, why: str) -> None:
        """Fails all open calls after the loss of the connection."""
        with self._line.lock:
            calls, self._calls = self._calls, {}
        for call in calls.values():
            call.reply.fail(GraphError(why))

    # ------------------------------------------------------------------------------------- calls

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; without a request rosapi is first asked for its type."""
        if request is not None:
            name: str = request.__msgtype__
            self._call(service, name.removesuffix("_Request"), request, reply)
            return

        def ask(answer: Any) -> None:
            try:
                if not answer.type:
                    raise GraphError(f"service '{service}' has no server")
                srvtype = ros2_name(answer.type, "srv")
                self._call(service, srvtype, zero_message(f"{srvtype}_Request"), reply)
            except GraphError as error:
                reply.fail(error)

        question = message_type("rosapi_msgs/srv/ServiceType_Request")(service=service)
        self._call(_TYPE_OF, "rosapi_msgs/srv/ServiceType", question, ServiceReply(ask, reply.fail))

    def _call(self, service: str, srvtype: str, request: Any, reply: ServiceReply) -> None:
        with self._line.lock:
            if self._line.open:
                body = self._line.payloads.encode(request, f"{srvtype}_Request")
                self._register(service, srvtype)
                number = next(self._numbers)
                self._calls[number] = _Call(service, srvtype, reply)
                reply.when_done(lambda: self._forget(number))
                self._line.command("request", (service, body), srv_id=number)
                return
        reply.fail(GraphError(f"service '{service}': there is no connection"))

    def _register(self, service: str, srvtype: str) -> None:
        if (service, srvtype) not in self._registered:
            self._registered.add((service, srvtype))
            name = self._line.payloads.short(srvtype)
            self._line.command("ros_service", topic=service, message_name=name)

    def _forget(self, number: int) -> None:
        with self._line.lock:
            self._calls.pop(number, None)

    def take_response(self, number: int, frame: RosTcpFrame) -> None:
        """Completes a call. Raises `BridgeError` for an unknown call."""
        with self._line.lock:
            call = self._calls.pop(number, None)
        if call is None:
            raise BridgeError(f"a response to request {number}, which is not open")
        failure = GraphError(f"service '{call.service}': {call.why or 'it sent no response'}")
        if not frame.payload and call.why:
            call.reply.fail(failure)
            return
        try:
            response = self._line.payloads.decode(frame.payload, f"{call.srvtype}_Response")
        except GraphError as error:
            call.reply.fail(error if frame.payload else failure)
            return
        call.reply.answer(response)

    def on_error(self, text: str) -> None:
        """Passes the endpoint's error about a service to its callers.

        An endpoint that reports a reason in this way, without an empty response, will not respond.
        """
        found = _OF_SERVICE.search(text)
        if found is None:
            return
        name, why = absolute(found[1]), found[2] or text
        with self._line.lock:
            calls = [call for call in self._calls.values() if call.service == name]
        for call in calls:
            call.why = why
            if ros_tcp.RESPONSE_ERROR not in self._line.features:
                call.reply.fail(GraphError(text))

    # ------------------------------------------------------------------------------------ offers

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service. Raises `GraphError` for an unknown type or an existing service."""
        known(f"{srvtype}_Request")
        with self._line.lock:
            if service in self._offers:
                raise GraphError(f"service '{service}' exists already")
            self._offers[service] = _Offer(srvtype, handler)
            self._announce(service, srvtype)

    def destroy_service(self, service: str, client_name: str) -> None:
        """Destroys a service; its open requests fail."""
        with self._line.lock:
            offer = self._offers.pop(service, None)
            if offer is None:
                raise GraphError(f"{client_name} has no service '{service}'")
            if ros_tcp.REMOVE in self._line.features:
                self._line.command("remove_unity_service", topic=service)
        for reply in tuple(offer.pending):
            reply.fail(GraphError(f"service '{service}': {client_name} is closed"))

    @property
    def offered(self) -> tuple[str, ...]:
        """Names of the offered services."""
        return tuple(self._offers)

    def take_request(self, number: int, frame: RosTcpFrame) -> None:
        """Passes a request to its handler; the caller receives the handler's error."""
        offer = self._offers.get(absolute(frame.destination))
        name, connection = frame.destination, self._connection
        if offer is None:
            self._respond(connection, number, name, error=f"'{name}' does not exist here")
            return

        def answer(message: Any) -> None:
            try:
                body = self._line.payloads.encode(message, f"{offer.srvtype}_Response")
            except GraphError as error:
                fail(error)
            else:
                self._respond(connection, number, name, body)

        def fail(error: GraphError) -> None:
            self._respond(connection, number, name, error=str(error))

        reply = ServiceReply(answer, fail)
        try:
            request = self._line.payloads.decode(frame.payload, f"{offer.srvtype}_Request")
            offer.pending.add(reply)
            reply.when_done(lambda: offer.pending.discard(reply))
            offer.handler(request, reply)
        except GraphError as error:
            reply.fail(error)
        except Exception as error:
            reply.fail(GraphError(f"{type(error).__name__}: {error}"))

    def _respond(
        self, connection: int, number: int, name: str, body: bytes = b"", error: str | None = None
    ) -> None:
        fields: dict[str, Any] = {"srv_id": number}
        if error is not None and ros_tcp.RESPONSE_ERROR in self._line.features:
            fields["error"] = error
        with self._line.lock:
            if connection == self._connection:  # numbers are invalid on another one
                self._line.command("response", (name, body), **fields)

    def _announce(self, service: str, srvtype: str) -> None:
        name = self._line.payloads.short(srvtype)
        self._line.command("unity_service", topic=service, message_name=name)
