"""Services of nodes on workers, which clients of the leader call like any others.

A client's call crosses as a command; the worker's response comes back at the same barrier.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from functools import partial
from typing import Any

from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.graph import Graph
from volery.graph.service_reply import ServiceReply


class NodeServices:
    """Offers the services on the leader's graph until their workers respond."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._pending: dict[str, deque[ServiceReply]] = {}
        self._types: dict[str, str] = {}

    def offer(self, worker: str, services: Mapping[str, str]) -> None:
        """Creates those of the worker's services, types by name, that are not offered yet.

        Raises `GraphError` if the leader has a service of that name.
        """
        for name, srvtype in services.items():
            if name not in self._pending:
                pending = self._pending[name] = deque()
                self._types[name] = srvtype
                self._graph.create_async_service(
                    name,
                    srvtype,
                    partial(_keep, pending),
                    owner=worker,
                )

    def withdraw(self, services: Collection[str]) -> None:
        """Destroys services; pending calls fail."""
        for name in services:
            if name in self._pending:
                self._graph.destroy_service(name)
                for reply in self._pending.pop(name):
                    reply.fail(GraphError(f"service '{name}': its worker is lost"))

    def answer(self, name: str, cdr: bytes, failure: str) -> None:
        """Passes a worker's response on to the client that has waited longest."""
        if not self._pending.get(name):
            return
        reply = self._pending[name].popleft()
        if failure:
            reply.fail(GraphError(failure))
        else:
            response: Any = decode_cdr(cdr, f"{self._types[name]}_Response")
            reply.answer(response)


def _keep(pending: deque[ServiceReply], _request: Any, reply: ServiceReply) -> None:
    """Keeps the reply to a call, which crosses as a command."""
    pending.append(reply)
