"""Joins a ROS 2 graph with a middleware, a domain and its requirements."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from typing import Literal, NamedTuple

from volery.bridges.ros2.middleware import Participant
from volery.core.errors import BridgeError
from volery.core.extras import import_extra
from volery.graph.nodes.imports import withdraw_ros_imports

Kind = Literal["dds", "zenoh", "rclpy"]

MAX_DOMAIN_ID = 232
"""Largest domain: beyond, the ports of DDS do not fit into 16 bits (RTPS 2.5, 9.6.2.3)."""


class Ros2Environment(NamedTuple):
    """Connection of a ROS 2 graph."""

    middleware: Kind = "dds"
    """`rclpy`: the middleware of the sourced ROS 2; for nodes, not for the bridge."""
    domain_id: int | None = None
    """None: the variable ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces for DDS, by name or address; empty: this machine alone."""
    router: str = ""
    """HOST:PORT of zenoh's router; empty: this machine's, at its default port."""


def join_ros2(terms: Ros2Environment) -> Participant:
    """Joins a ROS 2 graph. Raises `BridgeError` with what is missing."""
    withdraw_ros_imports()
    domain_id = domain_of(terms.domain_id)
    if terms.middleware == "dds":
        import_extra("ROS 2 over dds", "cyclonedds.domain", "cyclonedds", "ros2", BridgeError)
        from volery.bridges.ros2.dds.participant import DdsParticipant

        return DdsParticipant(domain_id, _checked(terms.interfaces))
    if terms.middleware == "rclpy":
        return _sourced(domain_id)
    import_extra("ROS 2 over zenoh", "zenoh", "eclipse-zenoh", "ros2", BridgeError)
    from volery.bridges.ros2.zenoh.participant import ZenohParticipant

    return ZenohParticipant(domain_id, terms.router)


def _sourced(domain_id: int) -> Participant:
    """Joins with the sourced ROS 2. Raises `BridgeError` if it does not work."""
    if importlib.util.find_spec("rclpy") is None:
        raise BridgeError(
            "there is no rclpy: source a ROS 2 (. /opt/ros/jazzy/setup.sh) that is built for this "
            "version of Python; without one use ros2 in place of rclpy"
        )
    try:
        from volery.bridges.ros2.rcl.participant import RclParticipant

        return RclParticipant(domain_id)
    except (ImportError, RuntimeError) as error:  # of another Python, or a missing rmw
        raise BridgeError(f"rclpy does not start: {error}") from None


def domain_of(given: int | None) -> int:
    """Returns the given domain, or ROS_DOMAIN_ID. Raises `BridgeError` for an invalid one."""
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0" if given is None else str(given)
    if not text.isdecimal() or int(text) > MAX_DOMAIN_ID:
        source = "ROS_DOMAIN_ID" if given is None else "domain id"
        raise BridgeError(f"{source}: a number from 0 to {MAX_DOMAIN_ID}, not '{text}'")
    return int(text)


def _checked(interfaces: Sequence[str]) -> tuple[str, ...]:
    for name in interfaces:
        if not name or any(letter in name for letter in "<>&\"' "):
            raise BridgeError(f"'{name}' is not a network interface")
    return tuple(interfaces)
