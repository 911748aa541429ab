"""Provides the contents of `rclpy.event_handler` and other modules without effect in Volery.

Inside the simulation no message is lost or late and no profiles disagree: no event occurs. Services
are not introspected.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

from volery.core.errors import GraphError


class _EventCallbacks:
    """Callbacks of events by name; none is ever called."""

    def __init__(self, **callbacks: Callable[..., Any] | None) -> None:
        if callbacks.get("matched") is not None:
            raise GraphError(
                "Volery reports no matched events: ask count_publishers or "
                "get_subscription_count in a timer"
            )


class PublisherEventCallbacks(_EventCallbacks):
    """See `rclpy.event_handler`."""


class SubscriptionEventCallbacks(_EventCallbacks):
    """See `rclpy.event_handler`."""


class ServiceIntrospectionState(IntEnum):
    """What a service or client would publish of its calls."""

    OFF = 0
    METADATA = 1
    CONTENTS = 2


def configure_introspection(_clock: Any, _qos_profile: Any, state: int) -> None:
    """Accepts OFF. Raises `GraphError` for other states."""
    if state != ServiceIntrospectionState.OFF:
        raise GraphError("Volery publishes no service events: log the calls in the callback")


class QosCallbackResult:
    """What a callback of `QoSOverridingOptions` returns."""

    def __init__(self) -> None:
        self.successful = False
        self.reason = ""


class QoSOverridingOptions:
    """Has no effect: no parameter changes a profile."""

    def __init__(self, *_arguments: Any, **_options: Any) -> None:
        pass

    @classmethod
    def with_default_policies(cls, **_options: Any) -> QoSOverridingOptions:
        """Returns options without effect."""
        return cls()


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    callbacks = {
        "PublisherEventCallbacks": PublisherEventCallbacks,
        "SubscriptionEventCallbacks": SubscriptionEventCallbacks,
    }
    return {
        "rclpy.event_handler": {
            **callbacks,
            "QoSPublisherMatchedInfo": object,
            "QoSSubscriptionMatchedInfo": object,
        },
        "rclpy.qos_event": callbacks,
        "rclpy.service_introspection": {"ServiceIntrospectionState": ServiceIntrospectionState},
        "rclpy.qos_overriding_options": {
            "QosCallbackResult": QosCallbackResult,
            "QoSOverridingOptions": QoSOverridingOptions,
        },
    }
