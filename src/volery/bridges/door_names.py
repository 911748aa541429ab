"""Doors by name, as the command line asks for them: `rosbridge`, `ros-tcp=127.0.0.1:10001`."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple

from volery.bridges.doors import Door
from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.bridges.ros2.environment import Ros2Terms


class Address(NamedTuple):
    """Where a door listens or connects to."""

    host: str
    port: int


class Terms(NamedTuple):
    """What holds for all doors of a run."""

    anywhere: bool = False
    """Whether doors may listen beyond loopback."""
    token: str | None = None
    """What clients must show, where the protocol can carry it."""
    domain_id: int | None = None
    """ROS 2 domain; None: that of ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Of the network, for ROS 2 over DDS; none: this machine alone."""
    report: Callable[[str], None] | None = None
    """Called by any thread with lines for people: connections begin or end. None: logged."""


class DoorKind(NamedTuple):
    """A door that can be asked for: the port where none is said, how it is made.

    on_line: it is no port of a host but a serial line, PATH[:BAUD].
    """

    port: int
    make: Callable[[Address, Terms], Door]
    on_line: bool = False


def make_door(text: str, terms: Terms, more: Mapping[str, DoorKind] | None = None) -> Door:
    """Door of `NAME` or `NAME=[HOST:]PORT`. `BridgeError` tells which there are.

    more: doors of other rooms by name, beside those of this one.
    """
    name, _, address = text.partition("=")
    kinds = {**_KINDS, **(more or {})}
    kind = kinds.get(name)
    if kind is None:
        near = difflib.get_close_matches(name, kinds, n=1)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        raise BridgeError(f"no door '{name}'.{hint} Doors: {', '.join(kinds)}")
    parse = _parse_line if kind.on_line else _parse
    return kind.make(parse(address, kind.port, text), terms)


def _parse(address: str, port: int, text: str) -> Address:
    host = _HERE
    if address:
        before, colon, after = address.rpartition(":")
        if colon:
            host = before.strip("[]")
        if not after.isdecimal() or not 0 <= int(after) <= 65535:
            raise BridgeError(f"'{text}': an address is PORT or HOST:PORT, port 0 to 65535")
        port = int(after)
    return Address(host, port)


def _parse_line(address: str, baud: int, text: str) -> Address:
    path, colon, after = address.rpartition(":")
    if not colon:
        path = address
    elif after.isdecimal():
        baud = int(after)
    if not path or (colon and not after.isdecimal()):
        raise BridgeError(f"'{text}': a serial line is PATH or PATH:BAUD")
    return Address(path, baud)


def _rosbridge(address: Address, terms: Terms) -> Door:
    from volery.bridges.rosbridge.server import RosbridgeServer

    return RosbridgeServer(*address, token=terms.token, anywhere=terms.anywhere)


def _ros_tcp(address: Address, terms: Terms) -> Door:
    return _ros_tcp_endpoint(address, terms, "ros1")


def _ros_tcp_2(address: Address, terms: Terms) -> Door:
    return _ros_tcp_endpoint(address, terms, "ros2")


def _ros_tcp_endpoint(address: Address, terms: Terms, generation: Literal["ros1", "ros2"]) -> Door:
    from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
    from volery.bridges.rosbridge.beside import WithRosApi

    return WithRosApi(RosTcpEndpoint(*address, generation=generation, anywhere=terms.anywhere))


def _ros_tcp_connector(address: Address, terms: Terms) -> Door:
    from volery.bridges.ros_tcp.connector import RosTcpConnector

    return RosTcpConnector(*address, report=terms.report)


def _ros1(address: Address, terms: Terms) -> Door:
    from volery.bridges.ros1.door import Ros1Door

    uri = f"http://{address.host}:{address.port}" if address.port else None
    return Ros1Door(uri, anywhere=terms.anywhere)


def _ros2(address: Address, terms: Terms) -> Door:
    from volery.bridges.ros2.environment import Ros2Terms

    if address.host != _HERE:
        raise BridgeError("ros2=N names a domain; interfaces are chosen with --ros2-interface")
    domain_id = terms.domain_id if address.port == _UNSAID else address.port
    return _ros2_door(Ros2Terms("dds", domain_id, terms.interfaces))


def _ros2_zenoh(address: Address, terms: Terms) -> Door:
    from volery.bridges.ros2.environment import Ros2Terms

    router = "" if address.port == _UNSAID else f"{address.host}:{address.port}"
    return _ros2_door(Ros2Terms("zenoh", terms.domain_id, router=router))


def _ros2_door(terms: Ros2Terms) -> Door:
    from volery.bridges.ros2.door import Ros2Door
    from volery.bridges.rosbridge.beside import WithRosApi

    return WithRosApi(Ros2Door(terms))


def _sensor_link(address: Address, terms: Terms) -> Door:
    from volery.bridges.sensor_link.server import SensorLink

    image_port = address.port + 1 if address.port else 0
    return SensorLink(*address, image_port=image_port, anywhere=terms.anywhere)


_HERE = "127.0.0.1"
_UNSAID = -1
_KINDS = {
    "rosbridge": DoorKind(9090, _rosbridge),
    "ros-tcp": DoorKind(10000, _ros_tcp),
    "ros-tcp-2": DoorKind(10000, _ros_tcp_2),
    "ros-tcp-connector": DoorKind(10000, _ros_tcp_connector),
    "ros1": DoorKind(0, _ros1),
    "ros2": DoorKind(_UNSAID, _ros2),
    "ros2-zenoh": DoorKind(_UNSAID, _ros2_zenoh),
    "sensor-link": DoorKind(10100, _sensor_link),
}
