"""How services answer: with a result code of the standard, or with success and a message."""

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
"""Fields of a response by name; those that are missing stay zero."""
Handler = Callable[[Any], "Fields | None"]
Close = Callable[[], None]
"""Gives back what was opened."""
Settle = Callable[["Fields | Exception"], None]
"""Gives the answer: its fields, or what went wrong."""

_MAX_CHARACTERS = 1_000
"""Of the reason of a refusal."""


class ResultCode(IntEnum):
    """`simulation_interfaces/msg/Result`, what every service of the standard answers with."""

    FEATURE_UNSUPPORTED = 0
    OK = 1
    NOT_FOUND = 2
    INCORRECT_STATE = 3
    OPERATION_FAILED = 4


class RefusedError(Exception):
    """A request that is not fulfilled, with its result code and a reason for people."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = int(code)


def result(code: int = ResultCode.OK, reason: str = "") -> Any:
    """A `simulation_interfaces/msg/Result`."""
    return message_type("simulation_interfaces/msg/Result")(result=int(code), error_message=reason)


def filled(name: str, fields: Fields | None = None) -> Any:
    """A new message of type `name` with `fields`; all others are zero or empty."""
    message = zero_message(name)
    for key, value in (fields or {}).items():
        setattr(message, key, value)
    return message


def failed(error: Exception) -> Any:
    """The Result that tells of an error."""
    code = error.code if isinstance(error, RefusedError) else ResultCode.OPERATION_FAILED
    return result(code, reason_of(error))


def reason_of(error: Exception) -> str:
    """What an error says, shortened: a message may repeat what a client sent."""
    text = str(error)
    if len(text) <= _MAX_CHARACTERS:
        return text
    half = _MAX_CHARACTERS // 2
    return f"{text[:half]} ... {text[-half:]}"


def offer_result(graph: Graph, name: str, srvtype: str, handler: Handler) -> None:
    """Offer a service of the standard; what `handler` refuses becomes its `result`."""

    def handle(request: Any) -> Any:
        try:
            fields = handler(request)
        except (RefusedError, VoleryError) as error:
            return filled(f"{srvtype}_Response", {"result": failed(error)})
        return filled(f"{srvtype}_Response", {"result": result(), **(fields or {})})

    graph.offer(name, srvtype, handle)


def offer_result_later(
    graph: Graph, name: str, srvtype: str, ask: Callable[[Any, Settle], None]
) -> None:
    """Offer a service of the standard that `ask(request, settle)` answers some time."""

    def handle(request: Any, reply: ServiceReply) -> None:
        def settle(outcome: Fields | Exception) -> None:
            fields = {"result": failed(outcome)} if isinstance(outcome, Exception) else outcome
            reply.answer(filled(f"{srvtype}_Response", {"result": result(), **fields}))

        try:
            ask(request, settle)
        except (RefusedError, VoleryError) as error:
            settle(error)

    graph.offer_async(name, srvtype, handle)


def offer_command(graph: Graph, name: str, srvtype: str, handler: Handler) -> Close:
    """Offer a service of ours: `success`, and a `message` that says why not.

    What is returned withdraws it.
    """

    def handle(request: Any) -> Any:
        try:
            fields = handler(request)
        except (RefusedError, VoleryError) as error:
            return filled(f"{srvtype}_Response", {"success": False, "message": reason_of(error)})
        return filled(f"{srvtype}_Response", {"success": True, **(fields or {})})

    graph.offer(name, srvtype, handle)
    return lambda: graph.withdraw(name)
