"""Defines the bridges of this package; `pyproject.toml` gives them their names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from volery.core.errors import BridgeError
from volery.graph.bridge_kind import (
    LOOPBACK,
    NO_PORT,
    Address,
    Bridge,
    BridgeKind,
    BridgeOptions,
)

if TYPE_CHECKING:
    from volery.bridges.ros2.environment import Ros2Environment


def _rosbridge(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.rosbridge.server import RosbridgeServer

    return RosbridgeServer(
        *address, token=options.token, anywhere=options.allow_remote, origins=options.origins
    )


def _ros_tcp(address: Address, options: BridgeOptions) -> Bridge:
    return _ros_tcp_endpoint(address, options, "ros1")


def _ros_tcp_2(address: Address, options: BridgeOptions) -> Bridge:
    return _ros_tcp_endpoint(address, options, "ros2")


def _ros_tcp_endpoint(
    address: Address, options: BridgeOptions, generation: Literal["ros1", "ros2"]
) -> Bridge:
    from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
    from volery.bridges.rosbridge.rosapi_bridge import RosApiBridge

    endpoint = RosTcpEndpoint(*address, generation=generation, anywhere=options.allow_remote)
    return RosApiBridge(endpoint)


def _ros_tcp_connector(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.ros_tcp.connector import RosTcpConnector

    return RosTcpConnector(*address, report=options.report)


def _ros1(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.ros1.bridge import Ros1Bridge

    uri = f"http://{address.host}:{address.port}" if address.port else None
    return Ros1Bridge(uri, anywhere=options.allow_remote)


def _ros2(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.ros2.environment import Ros2Environment

    if address.host != LOOPBACK:
        raise BridgeError("ros2=N names a domain; interfaces are chosen with --ros2-interface")
    domain_id = options.domain_id if address.port == NO_PORT else address.port
    return _ros2_bridge(Ros2Environment("dds", domain_id, options.interfaces))


def _ros2_zenoh(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.ros2.environment import Ros2Environment

    router = "" if address.port == NO_PORT else f"{address.host}:{address.port}"
    return _ros2_bridge(Ros2Environment("zenoh", options.domain_id, router=router))


def _ros2_bridge(terms: Ros2Environment) -> Bridge:
    from volery.bridges.ros2.bridge import Ros2Bridge
    from volery.bridges.rosbridge.rosapi_bridge import RosApiBridge

    return RosApiBridge(Ros2Bridge(terms))


def _sensor_link(address: Address, options: BridgeOptions) -> Bridge:
    from volery.bridges.sensor_link.server import SensorLink

    image_port = address.port + 1 if address.port else 0
    return SensorLink(*address, image_port=image_port, anywhere=options.allow_remote)


ROSBRIDGE = BridgeKind(9090, _rosbridge)
ROS_TCP = BridgeKind(10000, _ros_tcp)
ROS_TCP_2 = BridgeKind(10000, _ros_tcp_2)
ROS_TCP_CONNECTOR = BridgeKind(10000, _ros_tcp_connector)
ROS1 = BridgeKind(0, _ros1)
ROS2 = BridgeKind(NO_PORT, _ros2)
ROS2_ZENOH = BridgeKind(NO_PORT, _ros2_zenoh)
SENSOR_LINK = BridgeKind(10100, _sensor_link)
