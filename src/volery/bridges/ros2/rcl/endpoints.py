"""Publishers, subscriptions, and the two halves of services, on nodes of rclpy."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from volery.bridges.ros2.middleware import (
    Profile,
    ServiceSpec,
    TakeMessage,
    TakeRequest,
    TopicSpec,
)
from volery.bridges.ros2.rcl.qos import qos_of
from volery.bridges.ros2.rcl.types import message_class, service_class


class RclWriter:
    """A publisher."""

    def __init__(self, node: Any, spec: TopicSpec) -> None:
        self._node = node
        kind = message_class(spec.msgtype)
        self._publisher = node.create_publisher(kind, spec.topic, qos_of(spec.profile))

    @property
    def matched(self) -> bool:
        """Whether the topic has subscribers."""
        return bool(self._publisher.get_subscription_count())

    def write(self, cdr: bytes) -> None:
        """Sends one message."""
        self._publisher.publish(cdr)

    def close(self) -> None:
        """Ends the publication."""
        self._node.destroy_publisher(self._publisher)


class RclReader:
    """A subscription."""

    def __init__(self, node: Any, spec: TopicSpec, take: TakeMessage) -> None:
        self._node = node
        kind = message_class(spec.msgtype)
        self._subscription = node.create_subscription(
            kind, spec.topic, take, qos_of(spec.profile), raw=True
        )

    def close(self) -> None:
        """Ends the subscription."""
        self._node.destroy_subscription(self._subscription)


class RclServer:
    """A service server.

    rclpy sends what a callback returns; a later answer is sent by the same method of its service.
    """

    def __init__(self, node: Any, spec: ServiceSpec, take: TakeRequest) -> None:
        self._node = node
        self._kind = service_class(spec.srvtype)
        self._take = take
        self._service = node.create_service(
            self._kind, spec.service, lambda request, _: request, qos_profile=qos_of(Profile())
        )
        self._send = self._service.send_response
        self._service.send_response = self._on_request

    def close(self) -> None:
        """Destroys the service."""
        self._node.destroy_service(self._service)

    def _on_request(self, request: Any, header: Any) -> None:
        def answer(cdr: bytes) -> None:
            self._send(deserialize_message(cdr, self._kind.Response), header)

        self._take(serialize_message(request), answer)


class RclCaller:
    """A client of a service."""

    def __init__(self, node: Any, spec: ServiceSpec) -> None:
        self._node = node
        self._kind = service_class(spec.srvtype)
        self._client = node.create_client(self._kind, spec.service, qos_profile=qos_of(Profile()))
        self._waiting: dict[Any, Callable[[], None]] = {}
        self._lock = threading.Lock()

    @property
    def ready(self) -> bool:
        """Whether the service has a server."""
        return bool(self._client.service_is_ready())

    @property
    def problem(self) -> str:
        """Empty, because all servers are supported."""
        return ""

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Sends a request."""
        with self._lock:
            future = self._client.call_async(deserialize_message(request, self._kind.Request))
            self._waiting[future] = on_loss

        def take(done: Any) -> None:
            with self._lock:
                awaited = self._waiting.pop(done, None)
            if awaited is not None:
                on_response(serialize_message(done.result()))

        future.add_done_callback(take)

    def give_up(self) -> None:
        """Fails all open requests if there is no server any more."""
        if self._waiting and not self.ready:
            self._lose()

    def close(self) -> None:
        """Destroys the client."""
        self._lose()
        self._node.destroy_client(self._client)

    def _lose(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for future, on_loss in waiting.items():
            self._client.remove_pending_request(future)
            on_loss()
