"""Calling services: at once, or with the answer as a later input."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.thinking import Thinker


class Answer:
    """A response that may still be on its way."""

    def __init__(self) -> None:
        self._response: Any = None
        self._done = False
        self._callbacks: list[Callable[[Answer], None]] = []

    def done(self) -> bool:
        """Whether the response is there."""
        return self._done

    def result(self) -> Any:
        """The response; `GraphError` while it is not there."""
        if not self._done:
            raise GraphError("the service has not answered yet; use add_done_callback")
        return self._response

    def add_done_callback(self, callback: Callable[[Answer], None]) -> None:
        """Call `callback(answer)` with the response, at once if it is there."""
        if self._done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def answer(self, response: Any) -> None:
        """Set the response and call back."""
        self._response, self._done = response, True
        for callback in self._callbacks:
            callback(self)


class Client:
    """Calls one service."""

    def __init__(self, graph: Graph, service: str, thinker: Thinker | None) -> None:
        self._graph = graph
        self._thinker = thinker
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
        return self._graph.call(self.service, request)

    def call_async(self, request: Any | None = None) -> Answer:
        """Call; the answer comes at once, or for a node with a latency as input after it."""
        answer = Answer()

        def ask() -> None:
            response = self._graph.call(self.service, request)
            if self._thinker is None:
                answer.answer(response)
            else:
                self._thinker.think(lambda: answer.answer(response))

        if self._thinker is None or not self._thinker.hold_back(ask):
            ask()
        return answer
