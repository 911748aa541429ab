"""Converts profiles and publishers to and from rclpy."""

from __future__ import annotations

from typing import Any

from volery.bridges.ros2.middleware import Profile, RemotePublisher


def qos_of(profile: Profile) -> Any:
    """Returns the `rclpy.qos.QoSProfile` of a publisher or subscription; history is keep-last."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=profile.depth,
        reliability=ReliabilityPolicy.RELIABLE
        if profile.reliable
        else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if profile.latched
        else DurabilityPolicy.VOLATILE,
    )


def profile_of(offered: Any) -> Profile:
    """Returns the profile of another participant's publisher."""
    return Profile(
        reliable=offered.reliability.name != "BEST_EFFORT",
        latched=offered.durability.name == "TRANSIENT_LOCAL",
    )


def remote_publisher(topic: str, info: Any) -> RemotePublisher:
    """Returns a publisher from rclpy's `TopicEndpointInfo`."""
    text = str(getattr(info, "topic_type_hash", ""))  # Humble has none
    type_hash = text if text.startswith("RIHS") else None
    return RemotePublisher(topic, info.topic_type, profile_of(info.qos_profile), type_hash)
