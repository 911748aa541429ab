"""Shares topics and services between a simulation and a ROS 1 graph, in both directions."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

from volery.bridges.ros1.node import Ros1Node
from volery.bridges.ros1.outgoing_topic import Ros1OutgoingTopic
from volery.bridges.ros1.writer_thread import Ros1WriterThread
from volery.bridges.shared_names import SharedNames
from volery.core.errors import GraphError
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Session
from volery.graph.topics import TopicInfo

_SERVICE_TIMEOUT_S = 30.0

_log = logging.getLogger(__name__)


class GraphSync:
    """Holds the shared names; `survey` updates them, in one thread at a time."""

    def __init__(self, node: Ros1Node, session: Session, sharing: SharedNames) -> None:
        self.node = node
        self._session = session
        self._sharing = sharing
        self._pump = Ros1WriterThread()
        self._outlets: dict[str, Ros1OutgoingTopic] = {}
        self._inlets: dict[str, Any] = {}
        self._services: dict[str, Any] = {}
        self._remote: set[str] = set()
        self._refused: set[str] = set()

    def survey(self) -> None:
        """Shares new topics and services, and removes old ones."""
        topics = {t.name: t for t in self._session.graph.topics() if self._sharing.has(t.name)}
        wanted = {name: (self._publishers(t), self._subscribers(t)) for name, t in topics.items()}
        for name, (publishers, subscribers) in wanted.items():
            self._update_outlet(topics[name], publishers)
            self._update_inlet(topics[name], publishers, subscribers)
        self._update_services()

    @property
    def dropped(self) -> dict[str, int]:
        """Number of messages that slow subscribers missed, by topic."""
        counts = {name: outlet.dropped for name, outlet in tuple(self._outlets.items())}
        return {name: count for name, count in counts.items() if count}

    def close(self) -> None:
        """Unregisters all topics and services."""
        for inlet in self._inlets.values():
            inlet.unregister()
        for service in self._services.values():
            service.shutdown()
        self._pump.close()
        for outlet in self._outlets.values():
            outlet.close()
        self._session.close()

    # ------------------------------------------------------------------------------------ topics

    def _publishers(self, topic: TopicInfo) -> int:
        """Returns the number of other publishers of a topic in the graph."""
        return topic.publishers - (self._session.published_type(topic.name) is not None)

    def _subscribers(self, topic: TopicInfo) -> int:
        """Returns the number of other subscribers of a topic in the graph."""
        outlet = self._outlets.get(topic.name)
        return topic.subscribers - (outlet is not None and outlet.holds)

    def _update_outlet(self, topic: TopicInfo, publishers: int) -> None:
        outlet = self._outlets.get(topic.name)
        if outlet is None:
            if publishers and self._is_publisher(topic):
                names = topic.name, topic.msgtype
                self._outlets[topic.name] = Ros1OutgoingTopic(
                    self.node, self._session, self._pump, names, latched=topic.latched
                )
        elif not outlet.is_current:
            outlet.wake()

    def _update_inlet(self, topic: TopicInfo, publishers: int, subscribers: int) -> None:
        name = topic.name
        takes = self._sharing.takes(name, publishers, subscribers)
        if takes and name not in self._inlets and self._is_publisher(topic):
            self._inlets[name] = self.node.subscriber(name, topic.msgtype, self._receive(topic))
        elif not takes and name in self._inlets:
            self._inlets.pop(name).unregister()
            if self._session.published_type(name) is not None:
                self._session.unadvertise(name)

    def _receive(self, topic: TopicInfo) -> Any:
        name, msgtype = topic.name, topic.msgtype
        decode = ros1_codec().decode
        keeps = False

        def receive(data: bytes, sender: str, latched: bool) -> None:
            nonlocal keeps
            if sender == self.node.name:
                return  # the graph's own messages
            try:
                message = decode(data, msgtype)
                outlet = self._outlets.get(name)
                if outlet is not None:
                    outlet.leave_out(message)
                keeps = keeps or latched  # one publisher represents all of them here
                self._session.advertise(name, msgtype, latched=keeps)
                self._session.publish(name, message)
            except GraphError as error:
                self._refuse(name, error)

        return receive

    def _is_publisher(self, topic: TopicInfo) -> bool:
        """Returns whether ROS 1 has a form of the topic's type."""
        if topic.name in self._refused:
            return False
        try:
            ros1_codec().learn(topic.msgtype)
            ros1_codec().md5(topic.msgtype)
        except GraphError as error:
            self._refuse(topic.name, error)
            return False
        return True

    def _refuse(self, name: str, error: Exception) -> None:
        """Logs once why a name cannot be shared."""
        if name not in self._refused:
            self._refused.add(name)
            _log.warning("ROS 1: %s: %s", name, error)

    # ---------------------------------------------------------------------------------- services

    def offer_remote(self, services: Mapping[str, str]) -> None:
        """Creates services of the graph for ROS 1 services.

        Raises `GraphError` for a wrong type or a taken name.
        """
        for name, srvtype in services.items():
            self._session.create_service(name, srvtype, self._caller(name, srvtype))
            self._remote.add(name)

    def _caller(self, name: str, srvtype: str) -> Any:
        def handle(request: Any, reply: ServiceReply) -> None:
            def ask() -> None:
                try:
                    reply.answer(self.node.call(name, srvtype, request))
                except GraphError as error:
                    reply.fail(error)
                except Exception as error:  # report any error to the caller
                    reply.fail(GraphError(f"service '{name}': {error}"))

            threading.Thread(target=ask, name=f"volery-ros1 {name}", daemon=True).start()

        return handle

    def _update_services(self) -> None:
        offered = {
            name: srvtype
            for name, srvtype in self._session.graph.services().items()
            if name not in self._remote and self._sharing.has(name)
        }
        for name in [name for name in self._services if name not in offered]:
            self._services.pop(name).shutdown()
        for name, srvtype in offered.items():
            if name in self._services or name in self._refused:
                continue
            try:
                self._services[name] = self.node.service(name, srvtype, self._answerer(name))
            except GraphError as error:
                self._refuse(name, error)

    def _answerer(self, name: str) -> Any:
        def answer(request: Any) -> Any:
            come: Future[Any] = Future()
            self._session.call(name, request, ServiceReply(come.set_result, come.set_exception))
            try:
                return come.result(_SERVICE_TIMEOUT_S)
            except FutureTimeout:
                text = f"service '{name}' did not answer within {_SERVICE_TIMEOUT_S:.0f} s"
                raise GraphError(text) from None

        return answer
