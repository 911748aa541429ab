"""Publishers, subscriptions, and the two halves of services, on nodes of rclpy's."""

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
        """Whether anybody subscribes."""
        return bool(self._publisher.get_subscription_count())

    def write(self, cdr: bytes) -> None:
        """Send one message."""
        self._publisher.publish(cdr)

    def close(self) -> None:
        """Publish no more."""
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
        """Subscribe no more."""
        self._node.destroy_subscription(self._subscription)


class RclServer:
    """A service on offer.

    rclpy sends what a callback returns; an answer that comes later is sent by the same method of
    its service, which is therefore called then.
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
        """Offer it no more."""
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
        """Whether a server is there."""
        return bool(self._client.service_is_ready())

    @property
    def problem(self) -> str:
        """All servers are understood."""
        return ""

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Send a request."""
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
        """Tell all who wait that no answer will come, if there is no server any more."""
        if self._waiting and not self.ready:
            self._lose()

    def close(self) -> None:
        """Call no more."""
        self._lose()
        self._node.destroy_client(self._client)

    def _lose(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for future, on_loss in waiting.items():
            self._client.remove_pending_request(future)
            on_loss()
