"""Calls services: with the response at once, or as a later input."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from typing import Any

from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.message_copies import copy_message
from volery.graph.nodes.deferred_execution import DeferredExecutor
from volery.graph.nodes.qos_events import configure_introspection
from volery.graph.service_reply import ServiceReply

Later = Callable[[Callable[[], None]], None]

_MAX_WAITS = 1000
"""Limit of waits for a service at one simulated time; more are an endless loop."""


class Future:
    """A pending response, with the interface of `rclpy.task.Future`; callbacks can await it."""

    def __init__(self, *, executor: Any = None) -> None:  # noqa: ARG002  # as in rclpy
        self._response: Any = None
        self._error: BaseException | None = None
        self._done = False
        self._cancelled = False
        self._callbacks: list[Callable[[Future], None]] = []

    def done(self) -> bool:
        """Returns whether the response has arrived, failed or been cancelled."""
        return self._done or self._cancelled

    def cancelled(self) -> bool:
        """Returns whether the future was cancelled."""
        return self._cancelled

    def cancel(self) -> None:
        """Cancels the future and calls its callbacks."""
        if not self.done():
            self._cancelled = True
            self._call_back()

    def exception(self) -> BaseException | None:
        """Returns the reason why there is no response; None with or before a response."""
        return self._error

    def result(self) -> Any:
        """Returns the response, None while it is pending. Raises the reason of a failure."""
        if self._error is not None:
            raise self._error
        return self._response

    def __await__(self) -> Generator[Future, None, Any]:
        """Returns the response when it is there; see `coroutines`."""
        if not self.done():
            yield self
        return self.result()

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        """Calls `callback(future)` when the future is done, at once if it is."""
        if self.done():
            callback(self)
        else:
            self._callbacks.append(callback)

    def set_result(self, result: Any) -> None:
        """Sets the response and calls the callbacks."""
        self._finish(result, None)

    def set_exception(self, exception: BaseException) -> None:
        """Sets the failure and calls the callbacks."""
        self._finish(None, exception)

    def _finish(self, response: Any, error: BaseException | None) -> None:
        if not self.done():
            self._response, self._error, self._done = response, error, True
            self._call_back()

    def _call_back(self) -> None:
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)


class Client:
    """Calls one service; the default request has zeros and empty texts.

    later: while the node is being constructed, returns a function that defers to the run's first
    tick; None afterwards. run: runs a callback of the node.
    """

    def __init__(
        self,
        graph: Graph,
        service: str,
        srvtype: str,
        executor: DeferredExecutor | None,
        *,
        later: Callable[[], Later | None],
        run: Callable[[Callable[[], None], str], None],
        receive: Callable[[Any], Any],
    ) -> None:
        self._graph = graph
        self._executor = executor
        self._later = later
        self._run = run
        self._receive = receive
        self.srv_type = srvtype
        self._request_type = f"{srvtype}_Request"
        self._looks = (0, 0)  # number of waits, and their time
        self.service = service

    @property
    def srv_name(self) -> str:
        """Name of the service."""
        return self.service

    service_name = srv_name
    configure_introspection = staticmethod(configure_introspection)

    def service_is_ready(self) -> bool:
        """Returns whether the service has a server."""
        return self._graph.has_service(self.service)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Returns whether the service has a server; simulated time cannot pass meanwhile.

        During the node's construction returns True: calls are then made when the clock starts, and
        servers that start later exist by then. Raises `GraphError` if a callback waits endlessly.
        """
        if self.service_is_ready() or self._later() is not None:
            return True
        now_ns = self._graph.now_ns()
        count, last_ns = self._looks
        self._looks = (count + 1 if last_ns == now_ns else 1, now_ns)
        if timeout_sec is None or count >= _MAX_WAITS:
            raise GraphError(
                f"service '{self.service}' has no server, and a callback cannot wait for one; "
                "check service_is_ready() in a timer"
            )
        return False

    def call(self, request: Any | None = None, timeout_sec: float | None = None) -> Any:  # noqa: ARG002
        """Calls and returns the response; raises `GraphError` for a node with a latency."""
        if self._executor is not None:
            raise GraphError(
                f"a node with a latency cannot wait for service '{self.service}': use call_async"
            )
        filled = self._filled(request)
        self._graph.on_node_call(self.service, filled)
        return self._receive(self._graph.call(self.service, filled))

    def call_async(self, request: Any | None = None) -> Future:
        """Calls; the response comes at once, or later from an external server.

        For a node with a latency, the response is the input of a callback of its own.
        """
        future = Future()
        filled = self._filled(request)
        later = self._later()
        if later is not None and not self.service_is_ready():
            later(lambda: self._send(filled, future))
        else:
            self._send(filled, future)
        return future

    def remove_pending_request(self, future: Future) -> None:
        """Cancels a pending response."""
        future.cancel()

    def destroy(self) -> None:
        """Does nothing: a client holds no resources."""

    def _send(self, request: Any, future: Future) -> None:
        occasion = f"response of {self.service}"

        def settle(how: Callable[[], None], caller: int) -> None:
            if threading.get_ident() != caller:
                self._graph.post(lambda: self._run(how, occasion))
            elif self._executor is not None:
                self._run(how, occasion)
            else:
                how()  # in the callback that called

        def call() -> None:
            here = threading.get_ident()
            reply = ServiceReply(
                lambda response: settle(lambda: future.set_result(self._receive(response)), here),
                lambda error: settle(lambda: future.set_exception(error), here),
            )
            self._graph.on_node_call(self.service, request)
            self._graph.call_async(self.service, request, reply)

        if self._executor is None or not self._executor.defer(call):
            call()

    def _filled(self, request: Any | None) -> Any:
        if request is None:
            return zero_message(self._request_type)
        name = getattr(request, "__msgtype__", None)
        if name != self._request_type:
            found = name or f"a {type(request).__name__}"
            raise GraphError(f"service '{self.service}' takes {self._request_type}, not {found}")
        return copy_message(request)
