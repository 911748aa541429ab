"""A participant in a ROS 2 graph over zenoh; a `middleware.Participant`."""

from __future__ import annotations

import itertools
import threading
import weakref
from collections.abc import Callable, Mapping
from typing import Any

import zenoh

from volery.bridges.ros2.middleware import (
    RemotePublisher,
    ServiceSpec,
    TakeMessage,
    TakeRequest,
    TopicSpec,
)
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.type_hashes import service_hash
from volery.bridges.ros2.zenoh.endpoints import (
    ZenohCaller,
    ZenohContext,
    ZenohReader,
    ZenohServer,
    ZenohWriter,
)
from volery.bridges.ros2.zenoh.names import (
    PUBLISHER,
    SERVER,
    SPACE,
    SUBSCRIPTION,
    ZenohEndpoint,
    node_token,
    read_token,
)
from volery.bridges.ros2.zenoh.session import open_session


class ZenohParticipant:
    """One process's participant in a domain.

    Parameters
    ----------
    domain_id
        ROS_DOMAIN_ID.
    router
        HOST:PORT; empty: this machine's, which the participant becomes if there is none.

    """

    def __init__(self, domain_id: int, router: str = "") -> None:
        self._domain_id = domain_id
        self._session, router_name = open_session(router)
        self.where = f"{router_name}, domain {domain_id}"
        self._context = ZenohContext(self._session, domain_id, self._ids)
        self._numbers = itertools.count()
        self._lock = threading.RLock()
        self._nodes: dict[NodeName, tuple[int, Any]] = {}
        self._others: dict[str, ZenohEndpoint] = {}
        self._listeners: list[Callable[[], None]] = []
        self._callers: weakref.WeakSet[ZenohCaller] = weakref.WeakSet()
        self._closed = False
        self._watch = self._session.liveliness().declare_subscriber(
            f"{SPACE}/{domain_id}/**", self._on_token, history=True
        )

    def add_node(self, node: NodeName) -> None:
        """Adds a node."""
        with self._lock:
            if node not in self._nodes:
                number = next(self._numbers)
                token = node_token(self._domain_id, self._context.zid, number, node)
                self._nodes[node] = number, self._context.declare(token)

    def remove_node(self, node: NodeName) -> None:
        """Removes a node."""
        with self._lock:
            found = self._nodes.pop(node, None)
        if found is not None:
            found[1].undeclare()

    def announce(self) -> None:
        """Does nothing: tokens are published at once."""

    def writer(self, spec: TopicSpec) -> ZenohWriter:
        """Creates a publisher."""
        return ZenohWriter(self._context, spec)

    def reader(self, spec: TopicSpec, take: TakeMessage) -> ZenohReader:
        """Creates a subscription."""
        return ZenohReader(self._context, spec, take)

    def server(self, spec: ServiceSpec, take: TakeRequest) -> ZenohServer:
        """Creates a service."""
        return ZenohServer(self._context, spec, take)

    def caller(self, spec: ServiceSpec) -> ZenohCaller:
        """Creates a client of a service."""
        caller = ZenohCaller(self._context, spec, self._is_there)
        with self._lock:
            self._callers.add(caller)
        return caller

    def publishers(self) -> list[RemotePublisher]:
        """Returns publishers of others."""
        return [
            RemotePublisher(e.name, e.msgtype, e.profile, e.type_hash)
            for e in self._of_kind(PUBLISHER)
        ]

    def topic_types(self) -> Mapping[str, str]:
        """Returns topics that others publish or subscribe to, and their types."""
        found = (*self._of_kind(SUBSCRIPTION), *self._of_kind(PUBLISHER))
        return {e.name: e.msgtype for e in found}

    def service_types(self) -> Mapping[str, str]:
        """Returns services of others, and their types."""
        return {e.name: e.msgtype for e in self._of_kind(SERVER)}

    def when_changed(self, callback: Callable[[], None]) -> None:
        """Calls `callback` when others appear or leave."""
        self._listeners.append(callback)

    def close(self) -> None:
        """Leaves the graph; further calls do nothing."""
        if not self._closed:
            self._closed = True
            self._session.close()

    def _ids(self, node: NodeName) -> tuple[int, int]:
        self.add_node(node)
        with self._lock:
            return self._nodes[node][0], next(self._numbers)

    def _of_kind(self, kind: str) -> list[ZenohEndpoint]:
        with self._lock:
            return [endpoint for endpoint in self._others.values() if endpoint.kind == kind]

    def _is_there(self, spec: ServiceSpec) -> bool:
        wanted = (spec.service, spec.srvtype, service_hash(spec.srvtype))
        return any((e.name, e.msgtype, e.type_hash) == wanted for e in self._of_kind(SERVER))

    def _on_token(self, sample: Any) -> None:
        token = str(sample.key_expr)
        endpoint = read_token(token)
        if endpoint is None or endpoint.session == self._context.zid:
            return
        with self._lock:
            if sample.kind == zenoh.SampleKind.PUT:
                self._others[token] = endpoint
            else:
                self._others.pop(token, None)
            callers = tuple(self._callers)
        for caller in callers:
            caller.give_up()
        for callback in tuple(self._listeners):
            callback()
