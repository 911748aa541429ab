"""Joins a ROS 2 graph: which middleware, which domain, what must be installed."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from typing import Literal, NamedTuple

from volery.bridges.ros2.middleware import Participant
from volery.core.errors import BridgeError

Kind = Literal["dds", "zenoh"]

MOST_DOMAIN = 232
"""Beyond, the ports of DDS do not fit into 16 bits (RTPS 2.5, 9.6.2.3)."""

_PACKAGES = {"dds": "cyclonedds", "zenoh": "zenoh"}


class Ros2Terms(NamedTuple):
    """Where to find the ROS 2 graph."""

    middleware: Kind = "dds"
    domain_id: int | None = None
    """None: that of the variable ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Of the network, for DDS, by name or address; none: this machine alone."""
    router: str = ""
    """HOST:PORT of zenoh's router; empty: this machine's, at its usual port."""


def join_ros2(terms: Ros2Terms) -> Participant:
    """Take part in a ROS 2 graph. `BridgeError` tells what is missing."""
    package = _PACKAGES[terms.middleware]
    if importlib.util.find_spec(package) is None:
        raise BridgeError(
            f"ROS 2 over {terms.middleware} needs the package {package}, which is not installed; "
            'use pip install "volery[ros2]"'
        )
    domain_id = domain_of(terms.domain_id)
    if terms.middleware == "dds":
        from volery.bridges.ros2.dds.participant import DdsParticipant

        return DdsParticipant(domain_id, _checked(terms.interfaces))
    from volery.bridges.ros2.zenoh.participant import ZenohParticipant

    return ZenohParticipant(domain_id, terms.router)


def domain_of(given: int | None) -> int:
    """The domain that is asked for, or that of ROS_DOMAIN_ID. `BridgeError` for what is none."""
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0" if given is None else str(given)
    if not text.isdecimal() or int(text) > MOST_DOMAIN:
        source = "ROS_DOMAIN_ID" if given is None else "domain id"
        raise BridgeError(f"{source}: a number from 0 to {MOST_DOMAIN}, not '{text}'")
    return int(text)


def _checked(interfaces: Sequence[str]) -> tuple[str, ...]:
    for name in interfaces:
        if not name or any(letter in name for letter in "<>&\"' "):
            raise BridgeError(f"'{name}' is no network interface")
    return tuple(interfaces)
