"""Builds service responses: with a result code of the standard, or with success and message."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

from volery.core.errors import VoleryError
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply

Fields = Mapping[str, Any]
"""Fields of a response by name; missing ones stay zero."""
Handler = Callable[[Any], "Fields | None"]
Close = Callable[[], None]
"""Undoes what was opened."""
Settle = Callable[["Fields | Exception"], None]
"""Passes the response: its fields, or the error."""

_MAX_CHARACTERS = 1_000
"""Max length of a refusal's reason."""


class ResultCode(IntEnum):
    """Enumerates `simulation_interfaces/msg/Result`, the codes of all standard services."""

    FEATURE_UNSUPPORTED = 0
    OK = 1
    NOT_FOUND = 2
    INCORRECT_STATE = 3
    OPERATION_FAILED = 4


class RefusedError(Exception):
    """Refuses a request, with a result code and a reason in plain text."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = int(code)


def result(code: int = ResultCode.OK, reason: str = "") -> Any:
    """Returns a `simulation_interfaces/msg/Result`."""
    return message_type("simulation_interfaces/msg/Result")(result=int(code), error_message=reason)


def filled(name: str, fields: Fields | None = None) -> Any:
    """Returns a new message of type `name` with `fields`; all others are zero or empty."""
    message = zero_message(name)
    for key, value in (fields or {}).items():
        setattr(message, key, value)
    return message


def failed(error: Exception) -> Any:
    """Returns the Result for an error."""
    code = error.code if isinstance(error, RefusedError) else ResultCode.OPERATION_FAILED
    return result(code, reason_of(error))


def reason_of(error: Exception) -> str:
    """Returns the text of an error, shortened, as a message may contain client data."""
    text = str(error)
    if len(text) <= _MAX_CHARACTERS:
        return text
    half = _MAX_CHARACTERS // 2
    return f"{text[:half]} ... {text[-half:]}"


def offer_result(graph: Graph, name: str, srvtype: str, handler: Handler) -> None:
    """Creates a service of the standard; errors of `handler` become its `result`."""

    def handle(request: Any) -> Any:
        try:
            fields = handler(request)
        except (RefusedError, VoleryError) as error:
            return filled(f"{srvtype}_Response", {"result": failed(error)})
        return filled(f"{srvtype}_Response", {"result": result(), **(fields or {})})

    graph.create_service(name, srvtype, handle)


def offer_result_later(
    graph: Graph, name: str, srvtype: str, begin: Callable[[Any, Settle], None]
) -> None:
    """Creates a service of the standard that `begin(request, settle)` answers later."""

    def handle(request: Any, reply: ServiceReply) -> None:
        def settle(outcome: Fields | Exception) -> None:
            fields = {"result": failed(outcome)} if isinstance(outcome, Exception) else outcome
            reply.answer(filled(f"{srvtype}_Response", {"result": result(), **fields}))

        try:
            begin(request, settle)
        except (RefusedError, VoleryError) as error:
            settle(error)

    graph.create_async_service(name, srvtype, handle)


def offer_command(graph: Graph, name: str, srvtype: str, handler: Handler) -> Close:
    """Creates a service of `volery_interfaces`, with `success` and, on errors, a `message`.

    The returned function destroys the service.
    """

    def handle(request: Any) -> Any:
        try:
            fields = handler(request)
        except (RefusedError, VoleryError) as error:
            return filled(f"{srvtype}_Response", {"success": False, "message": reason_of(error)})
        return filled(f"{srvtype}_Response", {"success": True, **(fields or {})})

    graph.create_service(name, srvtype, handle)
    return lambda: graph.destroy_service(name)
