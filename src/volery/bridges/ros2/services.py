"""Shares services between a simulation and a ROS 2 graph, in both directions."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from volery.bridges.ros2.middleware import Answer, Caller, Handle, Participant, ServiceSpec
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.bridges.shared_names import SharedNames
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Session

_LONGEST_WAIT_S = 10.0
"""Time for a server to appear, which DDS may take seconds to discover."""
_PAUSE_S = 0.005


class Ros2Services:
    """Holds the shared services; `survey` updates them, in one thread at a time."""

    def __init__(
        self,
        participant: Participant,
        session: Session,
        sharing: SharedNames,
        node: NodeName,
        worker: Ros2WriterThread,
    ) -> None:
        self._participant = participant
        self._session = session
        self._sharing = sharing
        self._node = node
        self._worker = worker
        self._servers: dict[str, Handle] = {}
        self._callers: dict[str, Caller] = {}
        self._warnings = WarningFilter()

    def survey(self) -> None:
        """Creates ROS 2 servers of new services and destroys those of removed ones."""
        offered = {
            name: srvtype
            for name, srvtype in self._session.graph.services().items()
            if name not in self._callers and self._sharing.has(name) and _is_of_ros2(name)
        }
        for name in [name for name in self._servers if name not in offered]:
            self._servers.pop(name).close()
        for name, srvtype in offered.items():
            if name not in self._servers:
                self._warnings.tried(name, lambda n=name, t=srvtype: self._offer(n, t))  # type: ignore[misc]

    def _offer(self, name: str, srvtype: str) -> None:
        check_name(name)
        take = answerer(self._worker, srvtype, self._asker(name), self._warnings)
        spec = ServiceSpec(self._node, name, srvtype)
        self._servers[name] = self._participant.server(spec, take)

    def take_remote(self, services: Mapping[str, str]) -> None:
        """Creates services of the graph for ROS 2 services.

        Raises `GraphError` for a wrong type or a taken name.
        """
        for name, srvtype in services.items():
            check_name(name)
            spec = ServiceSpec(self._node, name, srvtype)
            caller = self._participant.caller(spec)
            self._session.create_service(name, srvtype, _forwarder(caller, spec))
            self._callers[name] = caller

    def close(self) -> None:
        """Destroys all shared services."""
        for server in self._servers.values():
            server.close()
        for caller in self._callers.values():
            caller.close()

    def _asker(self, name: str) -> Callable[[Any, ServiceReply], None]:
        return lambda request, reply: self._session.call(name, request, reply)


def _is_of_ros2(name: str) -> bool:
    """Returns whether ROS 2 has no equivalent of its own."""
    return not name.startswith("/rosapi/")


def answerer(
    worker: Ros2WriterThread,
    srvtype: str,
    ask: Callable[[Any, ServiceReply], None],
    warnings: WarningFilter,
) -> Callable[[bytes, Answer], None]:
    """Returns a `TakeRequest` that decodes requests for `ask` and encodes its responses.

    ROS 2 has no failure of services: the response reports it if it has a field for a reason, else
    there is no answer and a warning is logged.
    """
    response_type = f"{srvtype}_Response"

    def take(data: bytes, answer: Answer) -> None:
        def respond(response: Any) -> None:
            worker.post(lambda: answer(encode_cdr(response, response_type)))

        def fail(error: GraphError) -> None:
            warnings.warn(srvtype, str(error))
            refusal = _refusal(response_type, str(error))
            if refusal is not None:
                respond(refusal)

        try:
            request = decode_cdr(data, f"{srvtype}_Request")
        except GraphError as error:
            warnings.warn(srvtype, str(error))
            return
        ask(request, ServiceReply(respond, fail))

    return take


def _refusal(response_type: str, reason: str) -> Any | None:
    """Returns a response with a refusal and its reason; None if the type has no field for it."""
    response = zero_message(response_type)
    names = {field.name for field in fields(response)}
    if {"success", "message"} <= names and response.success is False:
        response.message = reason
        return response
    if "result" in names and hasattr(response.result, "error_message"):
        response.result.result = response.result.RESULT_OPERATION_FAILED
        response.result.error_message = reason
        return response
    return None


def ask_server(caller: Caller, spec: ServiceSpec, request: Any, reply: ServiceReply) -> None:
    """Calls a ROS 2 server after its discovery; `reply` receives its response or an error."""

    def respond(data: bytes) -> None:
        try:
            reply.answer(decode_cdr(data, f"{spec.srvtype}_Response"))
        except GraphError as error:
            reply.fail(error)

    def lose() -> None:
        reply.fail(GraphError(f"service '{spec.service}': its ROS 2 node has left"))

    try:
        wait_for(lambda: caller.ready or bool(caller.problem), _LONGEST_WAIT_S)
        if not caller.ready:
            raise GraphError(
                f"service '{spec.service}': {caller.problem}"
                if caller.problem
                else f"ROS 2 service '{spec.service}' has no server"
            )
        caller.call(encode_cdr(request, f"{spec.srvtype}_Request"), respond, lose)
    except GraphError as error:
        reply.fail(error)


def _forwarder(caller: Caller, spec: ServiceSpec) -> Callable[[Any, ServiceReply], None]:
    """Returns a handler of a service of the graph that forwards requests to a ROS 2 server."""

    def handle(request: Any, reply: ServiceReply) -> None:
        name = f"volery-ros2 {spec.service}"
        work = (caller, spec, request, reply)
        threading.Thread(target=ask_server, args=work, name=name, daemon=True).start()

    return handle


def wait_for(what: Callable[[], bool], timeout_s: float) -> bool:
    """Waits until a condition is true; returns whether it became true."""
    pause = threading.Event()
    for _ in range(max(int(timeout_s / _PAUSE_S), 1)):
        if what():
            return True
        pause.wait(_PAUSE_S)
    return what()
