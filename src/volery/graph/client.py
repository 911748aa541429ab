"""Calling services: at once, or with the answer as a later input."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.reply import Reply
from volery.graph.thinking import Thinker
from volery.graph.zero import zero_message


class Answer:
    """A response that may still be on its way."""

    def __init__(self) -> None:
        self._response: Any = None
        self._error: GraphError | None = None
        self._done = False
        self._callbacks: list[Callable[[Answer], None]] = []

    def done(self) -> bool:
        """Whether the response is there, or will never be."""
        return self._done

    def exception(self) -> GraphError | None:
        """Why there is no response; None where there is one, or may still be."""
        return self._error

    def result(self) -> Any:
        """The response; `GraphError` while it is not there, or where there is none."""
        if not self._done:
            raise GraphError("the service has not answered yet; use add_done_callback")
        if self._error is not None:
            raise self._error
        return self._response

    def add_done_callback(self, callback: Callable[[Answer], None]) -> None:
        """Call `callback(answer)` with the response, at once if it is there."""
        if self._done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def answer(self, response: Any) -> None:
        """Set the response and call back."""
        self._response = response
        self._finish()

    def fail(self, error: GraphError) -> None:
        """Say that there will be no response, and call back."""
        self._error = error
        self._finish()

    def _finish(self) -> None:
        self._done = True
        for callback in self._callbacks:
            callback(self)


class Client:
    """Calls one service; without a request with one of zeros and empty texts."""

    def __init__(self, graph: Graph, service: str, srvtype: str, thinker: Thinker | None) -> None:
        self._graph = graph
        self._thinker = thinker
        self._request_type = f"{srvtype}_Request"
        self.service = service

    def service_is_ready(self) -> bool:
        """Whether somebody offers the service."""
        return self._graph.has_service(self.service)

    def call(self, request: Any | None = None) -> Any:
        """Call and return the response, which comes at once; not for a node with a latency."""
        if self._thinker is not None:
            raise GraphError(
                f"a node with a latency cannot wait for service '{self.service}': use call_async"
            )
        return self._graph.call(self.service, self._filled(request))

    def call_async(self, request: Any | None = None) -> Answer:
        """Call; the answer comes at once, or later from a service outside.

        For a node with a latency it is input of a callback of its own.
        """
        answer = Answer()
        question = self._filled(request)

        def settle(how: Callable[[], None]) -> None:
            if self._thinker is None:
                how()
            else:
                self._thinker.think(how)

        def ask() -> None:
            here = threading.get_ident()

            def come_back(how: Callable[[], None]) -> None:
                if threading.get_ident() == here:
                    settle(how)
                else:
                    self._graph.post(lambda: settle(how))

            reply = Reply(
                lambda response: come_back(lambda: answer.answer(response)),
                lambda error: come_back(lambda: answer.fail(error)),
            )
            self._graph.call_async(self.service, question, reply)

        if self._thinker is None or not self._thinker.hold_back(ask):
            ask()
        return answer

    def _filled(self, request: Any | None) -> Any:
        return zero_message(self._request_type) if request is None else request
