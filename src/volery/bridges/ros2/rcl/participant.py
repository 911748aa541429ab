"""A participant in a ROS 2 graph on the sourced rclpy; a `middleware.Participant`.

Messages stay bytes: rclpy publishes and delivers them serialized. For nodes (`volery node ... --via
rclpy`), not for the bridge: rclpy cannot exclude messages of the same process.
"""

from __future__ import annotations

import logging
import threading
import time
import weakref
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from volery.bridges.ros2.middleware import (
    RemotePublisher,
    ServiceSpec,
    TakeMessage,
    TakeRequest,
    TopicSpec,
)
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.rcl.endpoints import RclCaller, RclReader, RclServer, RclWriter
from volery.bridges.ros2.rcl.qos import remote_publisher

_LOOK_S = 0.2
"""Period of graph queries: rclpy does not report changes of the graph."""
_NO_DESCRIPTIONS = Parameter("start_type_description_service", value=False)

_log = logging.getLogger(__name__)


class RclParticipant:
    """One process's participant in the graph of the sourced ROS 2.

    domain_id: ROS_DOMAIN_ID.
    """

    def __init__(self, domain_id: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id)
        rmw = rclpy.get_rmw_implementation_identifier()
        self.where = f"{rmw}, domain {domain_id}"
        self._executor = SingleThreadedExecutor(context=self._context)
        self._nodes: dict[NodeName, Any] = {}
        self._callers: weakref.WeakSet[RclCaller] = weakref.WeakSet()
        self._listeners: list[Callable[[], None]] = []
        self._known: list[RemotePublisher] = []
        self._lock = threading.RLock()
        self._closing = False
        self._thread = threading.Thread(target=self._spin, name="volery-rclpy", daemon=True)
        self._thread.start()

    def add_node(self, node: NodeName) -> None:
        """Adds a node. Its parameters are served like those of all Volery nodes."""
        with self._lock:
            self._node(node)

    def remove_node(self, node: NodeName) -> None:
        """Removes a node."""
        with self._lock:
            found = self._nodes.pop(node, None)
        if found is not None:
            self._executor.remove_node(found)
            found.destroy_node()

    def announce(self) -> None:
        """Does nothing: rclpy publishes everything at once."""

    def writer(self, spec: TopicSpec) -> RclWriter:
        """Creates a publisher."""
        return RclWriter(self._node(spec.node), spec)

    def reader(self, spec: TopicSpec, take: TakeMessage) -> RclReader:
        """Creates a subscription, which also receives this participant's own messages."""
        return RclReader(self._node(spec.node), spec, take)

    def server(self, spec: ServiceSpec, take: TakeRequest) -> RclServer:
        """Creates a service."""
        return RclServer(self._node(spec.node), spec, take)

    def caller(self, spec: ServiceSpec) -> RclCaller:
        """Creates a client of a service."""
        caller = RclCaller(self._node(spec.node), spec)
        with self._lock:
            self._callers.add(caller)
        return caller

    def publishers(self) -> list[RemotePublisher]:
        """Returns the current publishers of others."""
        with self._lock:
            own, eye = set(self._nodes), next(iter(self._nodes.values()), None)
        if eye is None:
            return []
        return [
            remote_publisher(topic, info)
            for topic, _ in eye.get_topic_names_and_types()
            for info in eye.get_publishers_info_by_topic(topic)
            if NodeName(info.node_namespace, info.node_name) not in own
        ]

    def topic_types(self) -> Mapping[str, str]:
        """Returns topics that are published or subscribed to, and their types."""
        with self._lock:
            eye = next(iter(self._nodes.values()), None)
        found = [] if eye is None else eye.get_topic_names_and_types()
        return {name: types[0] for name, types in found if types}

    def service_types(self) -> Mapping[str, str]:
        """Returns existing services, and their types."""
        with self._lock:
            eye = next(iter(self._nodes.values()), None)
        found = [] if eye is None else eye.get_service_names_and_types()
        return {name: types[0] for name, types in found if types}

    def when_changed(self, callback: Callable[[], None]) -> None:
        """Calls `callback` when others appear or leave."""
        self._listeners.append(callback)

    def close(self) -> None:
        """Leaves the graph; further calls do nothing."""
        if self._closing:
            return
        self._closing = True
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()
        for node in tuple(self._nodes):
            self._nodes.pop(node).destroy_node()
        rclpy.shutdown(context=self._context)

    def _node(self, name: NodeName) -> Any:
        with self._lock:
            if name not in self._nodes:
                made = rclpy.create_node(
                    name.name,
                    namespace=name.namespace,
                    context=self._context,
                    use_global_arguments=False,
                    start_parameter_services=False,
                    parameter_overrides=[_NO_DESCRIPTIONS],
                )
                self._nodes[name] = made
                self._executor.add_node(made)
            return self._nodes[name]

    def _spin(self) -> None:
        due_s = 0.0
        while not self._closing:
            try:
                self._executor.spin_once(timeout_sec=_LOOK_S)
                if time.monotonic() > due_s:
                    due_s = time.monotonic() + _LOOK_S
                    self._look()
            except Exception:  # an error of one message must not end the others
                if not self._closing:
                    _log.exception("rclpy: a received message could not be processed")

    def _look(self) -> None:
        with self._lock:
            callers = tuple(self._callers)
        for caller in callers:
            caller.give_up()
        known = self.publishers()
        if known != self._known:
            self._known = known
            for callback in tuple(self._listeners):
                callback()
