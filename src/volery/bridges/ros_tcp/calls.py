"""Calls services of the graph for either end of a ROS-TCP connection.

A failed call is answered with a `__response` of zero bytes: the protocol has no failure, and both
Unity's Connector and Unity's endpoint would wait for ever. Zero bytes make the deserializer throw
in the code that awaits the response (see `ROSConnection.cs`, `MessageDeserializer.cs` and
`tcp_sender.py`, v0.7.0; a response type without fields arrives as if nothing had failed).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.outbox import RosTcpOutbox
from volery.bridges.ros_tcp.payloads import absolute
from volery.bridges.ros_tcp.wire import RosTcpFrame
from volery.core.errors import BridgeError, GraphError
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Session

MAX_CALLS = 1000
"""Calls of one peer that may be open at once."""


class Calls:
    """Calls services for one peer; calls `complain`, in any thread, with each failure."""

    def __init__(
        self, session: Session, outbox: RosTcpOutbox, complain: Callable[[str], None]
    ) -> None:
        self._session = session
        self._outbox = outbox
        self._complain = complain
        self._open: set[ServiceReply] = set()

    def call(self, number: int, frame: RosTcpFrame, expected: str | None = None) -> None:
        """Calls the service that `frame` names, with its payload, as the peer's request `number`.

        expected: the service's type according to the peer.
        """
        name = frame.destination
        payloads = self._outbox.payloads

        def fail(error: Exception) -> None:
            self._complain(f"service '{name}': {error}")
            self.respond(number, name, b"")

        try:
            srvtype = self._type(absolute(name), expected)
            request = payloads.decode(frame.payload, f"{srvtype}_Request")
            if len(self._open) >= MAX_CALLS:
                raise BridgeError(f"over {MAX_CALLS} calls at once")
        except (BridgeError, GraphError) as error:
            fail(error)
            return

        def respond(response: Any) -> None:
            try:
                body = payloads.encode(response, f"{srvtype}_Response")
            except GraphError as error:
                fail(error)
            else:
                self.respond(number, name, body)

        reply = ServiceReply(respond, fail)
        self._open.add(reply)
        reply.when_done(lambda: self._open.discard(reply))
        self._session.call(absolute(name), request, reply)

    def respond(self, number: int, name: str, body: ros_tcp.Bytes) -> None:
        """Answers request `number`; `name` must not be empty, or the peer would see a keepalive."""
        header = ros_tcp.command("response", nul=self._outbox.ends_in_nul, srv_id=number)
        self._outbox.put(header + ros_tcp.frame(name, body))

    def _type(self, service: str, expected: str | None) -> str:
        offered = self._session.graph.services().get(service)
        if offered is None:
            raise GraphError("it has no server")
        if expected is not None and expected != offered:
            raise GraphError(f"its type is {offered}, not {expected}")
        return offered
