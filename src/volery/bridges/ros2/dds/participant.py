"""A participant in a ROS 2 graph over DDS; a `middleware.Participant`."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Mapping, Sequence

from volery.bridges.ros2.dds.discovery import Discovery
from volery.bridges.ros2.dds.discovery_info import DiscoveryInfo
from volery.bridges.ros2.dds.domain import join_domain, leave_domain
from volery.bridges.ros2.dds.endpoints import (
    DdsCaller,
    DdsContext,
    DdsReader,
    DdsServer,
    DdsWriter,
)
from volery.bridges.ros2.dds.reader_thread import ReaderThread
from volery.bridges.ros2.middleware import (
    RemotePublisher,
    ServiceSpec,
    TakeMessage,
    TakeRequest,
    TopicSpec,
)
from volery.bridges.ros2.names import NodeName


class DdsParticipant:
    """One process's participant in a domain.

    Parameters
    ----------
    domain_id
        ROS_DOMAIN_ID.
    interfaces
        Network interfaces by name or address; with none, this machine alone.

    """

    def __init__(self, domain_id: int, interfaces: Sequence[str] = ()) -> None:
        self._domain_id = domain_id
        self._participant = join_domain(domain_id, tuple(interfaces))
        interface_names = ", ".join(interfaces) or "this machine"
        self.where = f"DDS domain {domain_id} ({interface_names})"
        self._callers: weakref.WeakSet[DdsCaller] = weakref.WeakSet()
        self._servers: weakref.WeakSet[DdsServer] = weakref.WeakSet()
        self._lock = threading.Lock()
        self._reader_thread = ReaderThread(self._participant, self._check_callers)
        self._record = DiscoveryInfo(self._participant)
        self._context = DdsContext(self._participant, self._reader_thread, self._record)
        self._discovery = Discovery(self._participant, self._reader_thread)
        self._discovery.when_changed(self._check_clients)
        self._closed = False

    def add_node(self, node: NodeName) -> None:
        """Adds a node, published by the next `announce`."""
        self._record.add_node(node)

    def remove_node(self, node: NodeName) -> None:
        """Removes a node, published by the next `announce`."""
        self._record.remove_node(node)

    def announce(self) -> None:
        """Publishes the nodes and their endpoints."""
        self._record.publish()

    def writer(self, spec: TopicSpec) -> DdsWriter:
        """Creates a publisher."""
        return DdsWriter(self._context, spec)

    def reader(self, spec: TopicSpec, take: TakeMessage) -> DdsReader:
        """Creates a subscription."""
        return DdsReader(self._context, spec, take)

    def server(self, spec: ServiceSpec, take: TakeRequest) -> DdsServer:
        """Creates a service."""
        server = DdsServer(self._context, spec, take)
        with self._lock:
            self._servers.add(server)
        server.look_at(self._discovery.foreign_clients())
        server.look_at_types(self._discovery.asked_types())
        return server

    def caller(self, spec: ServiceSpec) -> DdsCaller:
        """Creates a client of a service."""
        caller = DdsCaller(self._context, spec)
        with self._lock:
            self._callers.add(caller)
        return caller

    def publishers(self) -> list[RemotePublisher]:
        """Returns publishers of others."""
        return self._discovery.publishers()

    def topic_types(self) -> Mapping[str, str]:
        """Returns topics that others publish or subscribe to, and their types."""
        return self._discovery.topic_types()

    def service_types(self) -> Mapping[str, str]:
        """Returns services of others, and their types."""
        return self._discovery.service_types()

    def when_changed(self, callback: Callable[[], None]) -> None:
        """Calls `callback` when others appear or leave."""
        self._discovery.when_changed(callback)

    def close(self) -> None:
        """Leaves the graph; further calls do nothing."""
        if not self._closed:
            self._closed = True
            self._reader_thread.close()
            leave_domain(self._domain_id, self._participant)

    def _check_clients(self) -> None:
        foreign, asked = self._discovery.foreign_clients(), self._discovery.asked_types()
        if asked:
            with self._lock:
                servers = tuple(self._servers)
            for server in servers:
                server.look_at(foreign)
                server.look_at_types(asked)

    def _check_callers(self) -> None:
        with self._lock:
            callers = tuple(self._callers)
        for caller in callers:
            caller.give_up()
