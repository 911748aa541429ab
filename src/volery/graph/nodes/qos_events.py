"""Provides the contents of `rclpy.event_handler` and `rclpy.qos_overriding_options`.

Inside the simulation no message is lost or late and no profiles disagree: no event occurs.
"""

from __future__ import annotations

from collections.abc import Callable
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
        "rclpy.qos_overriding_options": {
            "QosCallbackResult": QosCallbackResult,
            "QoSOverridingOptions": QoSOverridingOptions,
        },
    }
