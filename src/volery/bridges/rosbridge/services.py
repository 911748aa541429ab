"""Services of one rosbridge client: those it calls, and those it serves."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from volery.bridges.rosbridge.fields import (
    MAX_FRAGMENT,
    Id,
    absolute,
    read_choice,
    read_id,
    read_limit,
    read_text,
    with_id,
)
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Session
from volery.graph.typestore import typestore

MAX_CALLS = 1000
"""Open calls of one client, and open requests to it."""

Send = Callable[[Operation, int | None, str], None]
"""Sends an operation, with a fragment size and a compression."""
Post = Callable[[Callable[[], None]], None]
"""Calls a function in the client's thread, from any other."""


class RosbridgeServices:
    """The services of one client. All methods belong to the client's thread."""

    def __init__(self, session: Session, forms: MessageEncoder, send: Send, post: Post) -> None:
        self._session = session
        self._forms = forms
        self._send = send
        self._post = post
        self._calls: dict[int, tuple[float, ServiceReply]] = {}
        self._call_numbers = itertools.count()
        self._offers: dict[str, tuple[str, str]] = {}
        self._requests: dict[str, tuple[str, str, ServiceReply]] = {}
        self._request_numbers = itertools.count(1)

    # ------------------------------------------------------------------------------------- calls

    def call(self, operation: Operation, now_s: float) -> None:
        """Calls a service for the client."""
        name, key = read_text(operation, "service"), read_id(operation)
        fragment_size = int(read_limit(operation, "fragment_size", MAX_FRAGMENT)) or None
        compression = read_choice(operation, "compression", ("none", "png", "cbor", "cbor-raw"))
        compression = "cbor" if compression == "cbor-raw" else compression
        timeout_s = read_limit(operation, "timeout", 1e9)

        def respond(values: Any, success: bool) -> None:
            response = {"op": "service_response", "service": name, "values": values}
            self._send(with_id(response | {"result": success}, key), fragment_size, compression)

        try:
            service, srvtype = self._find(name)
            request = decode_plain(
                _arguments(operation, f"{srvtype}_Request"), f"{srvtype}_Request"
            )
        except (GraphError, BridgeError) as error:
            respond(str(error), False)
            return
        self._ask(service, srvtype, request, respond, now_s + timeout_s if timeout_s else None)

    def _ask(
        self,
        service: str,
        srvtype: str,
        request: Any,
        respond: Callable[[Any, bool], None],
        deadline_s: float | None,
    ) -> None:
        if len(self._calls) >= MAX_CALLS:
            respond(f"more than {MAX_CALLS} calls are open", False)
            return
        number = next(self._call_numbers)

        def answer(response: Any) -> None:
            if self._calls.pop(number, None) is None:
                return
            try:
                respond(self._forms.plain(response, f"{srvtype}_Response"), True)
            except GraphError as error:
                respond(str(error), False)

        def fail(error: GraphError) -> None:
            if self._calls.pop(number, None) is not None:
                respond(str(error), False)

        reply = ServiceReply(
            lambda response: self._post(lambda: answer(response)),
            lambda error: self._post(lambda: fail(error)),
        )
        self._calls[number] = (float("inf") if deadline_s is None else deadline_s, reply)
        self._session.call(service, request, reply)

    def _find(self, name: str) -> tuple[str, str]:
        """Returns name in the graph and type of a client's `/add` or, in old clients, `/add#3`."""
        service = absolute(name.partition("#")[0])
        return service, self._session.graph.service_type(service)

    def expire(self, now_s: float) -> None:
        """Fails calls that have timed out."""
        late = [reply for deadline_s, reply in self._calls.values() if deadline_s <= now_s]
        for reply in late:
            reply.fail(GraphError("no answer in time"))

    def due_s(self) -> float | None:
        """Returns the time of the next timeout; None if there is none."""
        deadline_s = min((deadline_s for deadline_s, _ in self._calls.values()), default=None)
        return None if deadline_s == float("inf") else deadline_s

    def close(self) -> None:
        """Forgets the client, which has left; its session fails what is open."""
        self._calls.clear()
        self._requests.clear()
        self._send, self._post = send_nothing, post_nothing

    # ----------------------------------------------------------------------------------- servers

    def advertise(self, operation: Operation) -> None:
        """Creates a service of the client; a repetition with the same type changes nothing."""
        name = read_text(operation, "service")
        srvtype = ros2_name(read_text(operation, "type"), "srv")
        if f"{srvtype}_Request" not in typestore().types:
            raise GraphError(f"service type '{srvtype}' is not known")
        service = absolute(name)
        if service in self._offers:
            if self._offers[service] == (name, srvtype):
                return
            self._session.destroy_service(service)

        def handle(request: Any, reply: ServiceReply) -> None:
            self._post(lambda: self._request(name, srvtype, request, reply))

        self._offers.pop(service, None)
        self._session.create_service(service, srvtype, handle)
        self._offers[service] = (name, srvtype)

    def unadvertise(self, operation: Operation) -> None:
        """Destroys a service; open requests fail."""
        service = absolute(read_text(operation, "service"))
        self._session.destroy_service(service)
        self._offers.pop(service, None)

    def _request(self, name: str, srvtype: str, request: Any, reply: ServiceReply) -> None:
        """Sends a request to the client."""
        if len(self._requests) >= MAX_CALLS:
            reply.fail(GraphError(f"service '{name}': its server is busy"))
            return
        number = f"call_service:{name}:{next(self._request_numbers)}"
        try:
            args = self._forms.plain(request, f"{srvtype}_Request")
            self._requests[number] = (absolute(name), srvtype, reply)
            reply.when_done(lambda: self._post(lambda: self._forget(number)))
            operation = {"op": "call_service", "id": number, "service": name, "args": args}
            self._send(operation, None, "none")
        except (GraphError, BridgeError) as error:
            reply.fail(GraphError(str(error)))

    def _forget(self, number: str) -> None:
        self._requests.pop(number, None)

    def respond(self, operation: Operation) -> None:
        """Handles the client's response to a request."""
        number: Id = read_id(operation)
        found = self._requests.pop(number, None) if isinstance(number, str) else None
        if found is None:
            raise BridgeError("service_response: no open request has this 'id'")
        service, srvtype, reply = found
        values = operation.get("values", {})
        if operation.get("result", True) is not True:
            why = values if isinstance(values, str) else "its server reports a failure"
            reply.fail(GraphError(f"service '{service}': {why}"))
            return
        try:
            response = decode_plain({} if values is None else values, f"{srvtype}_Response")
        except GraphError as error:
            reply.fail(GraphError(f"service '{service}' sent a wrong response: {error}"))
            raise
        reply.answer(response)


def send_nothing(_operation: Operation, _fragment_size: int | None, _compression: str) -> None:
    """Stands for the `Send` of a client that has left."""


def post_nothing(_action: Callable[[], None]) -> None:
    """Stands for the `Post` of a client that has left."""


def _arguments(operation: Operation, msgtype: str) -> Any:
    """Returns arguments as an object, also if they came as a list in the order of the fields."""
    args = operation.get("args")
    if args is None:
        return {}
    if not isinstance(args, list):
        return args
    names = [name for name, _ in typestore().fielddefs[msgtype][1] if name != EMPTY_MEMBER]
    if len(args) == 1 and isinstance(args[0], dict) and not set(args[0]) - set(names):
        return args[0]
    if len(args) > len(names):
        raise BridgeError(f"call_service: {len(args)} arguments for {len(names)} fields")
    return dict(zip(names, args, strict=False))
