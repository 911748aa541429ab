"""Connects `volery node`, `volery topic` and `volery service` to a graph."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from volery.cli.terminal import echo_line
from volery.core.errors import BridgeError, UnreachableError

if TYPE_CHECKING:
    from volery.bridges.nodes.deferred_connection import DeferredConnection
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.ros2.environment import Ros2Environment
    from volery.graph.connection import GraphConnection


DEFAULT_VIA = "rosbridge://127.0.0.1:9090"
CONNECTION_FORMS = "rosbridge://HOST:PORT, ros1, ros2, ros2-zenoh, rclpy or mavlink://ADDRESS"
ROS2_SCHEMES = ("ros2", "ros2-zenoh", "rclpy")
TIMEOUT_S = 30.0
"""Wall time for which a node in its own process waits for its graph; a world may take long to
build."""
_AGAIN_S = 0.2


def open_link(via: str, name: str) -> GraphConnection:
    """Joins the graph at `via` under a node name. Raises `BridgeError` if no server answers."""
    scheme, _, rest = via.partition("://")
    if scheme in ("rosbridge", "ws", "wss", "unix"):
        from volery.bridges.rosbridge.client import RosbridgeClient

        url = via if scheme != "rosbridge" else f"ws://{rest}"
        return RosbridgeClient(url, name=name)
    if scheme == "ros1":
        from volery.bridges.ros1.client import Ros1Client

        return Ros1Client(f"http://{rest}" if rest else None, _own_name(name))
    if scheme in ROS2_SCHEMES:
        from volery.bridges.ros2.client import Ros2Client

        return Ros2Client(_ros2_terms(via), f"/{_own_name(name)}")
    if scheme == "mavlink":
        from volery.mavlink.offboard.connection import OffboardConnection

        address, _, option = rest.partition("?")
        if not address or option not in ("", "engage"):
            raise BridgeError(f"'{via}': the form is mavlink://udpin:HOST:PORT, or with ?engage")
        return OffboardConnection(address, name, engages=option == "engage")
    raise _unknown_connection(via)


def await_link(via: str, name: str, timeout_s: float = TIMEOUT_S) -> GraphConnection:
    """Joins like `open_link`, but waits up to `timeout_s` for a graph that starts later."""
    until = time.monotonic() + timeout_s
    has_reported = False
    while True:
        try:
            return open_link(via, name)
        except UnreachableError as error:
            if time.monotonic() >= until:
                raise
            if not has_reported:
                has_reported = True
                echo_line(f"{error}; waiting up to {timeout_s:.0f} s", err=True)
            time.sleep(_AGAIN_S)


def join_late(late: DeferredConnection, host: NodeHost) -> GraphConnection:
    """Joins the graph of nodes that run already; their timers start after the connection."""
    before_ns = host.now_ns()
    link = late.join()
    host.postpone(host.now_ns() - before_ns)
    return link


class ConnectionMonitor:
    """Prints when the connection breaks and when it is back, at each call.

    Serves as the end condition of `NodeHost.spin`; the condition never holds.
    """

    def __init__(self, link: GraphConnection, via: str) -> None:
        self._link = link
        self._via = via
        self._was = True

    def __call__(self) -> bool:
        """Prints a change of the connection's state."""
        connected = getattr(self._link, "connected", True)
        if connected != self._was:
            self._was = connected
            what = "is connected again" if connected else "is disconnected; waiting for it"
            echo_line(f"the graph at {self._via} {what}", err=True)
        return False


def _ros2_terms(via: str) -> Ros2Environment:
    """Parses the environment of a ROS 2 connection.

    Known forms: `ros2://DOMAIN?interface=NAME`, `ros2-zenoh://HOST:PORT?domain=DOMAIN`,
    `rclpy://DOMAIN`.
    """
    from volery.bridges.ros2.environment import Ros2Environment

    parts = urlsplit(via)
    query = parse_qs(parts.query, keep_blank_values=True)
    kind = via.partition("://")[0]
    zenoh = kind == "ros2-zenoh"
    domain = query.pop("domain", [""])[-1] if zenoh else parts.netloc
    interfaces = tuple(query.pop("interface", ())) if kind == "ros2" else ()
    if query:
        known = {"ros2": "interface", "ros2-zenoh": "domain"}.get(kind)
        hint = f"{kind} supports {known}" if known else f"{kind} has no options"
        raise BridgeError(f"'{via}': unknown option '{next(iter(query))}'; {hint}")
    if parts.path.strip("/") not in ("", kind) or parts.fragment:
        raise _unknown_connection(via)
    if domain and not domain.isdecimal():
        raise BridgeError(f"'{via}': a domain is a number from 0 to 232, not '{domain}'")
    domain_id = int(domain) if domain else None
    if zenoh:
        return Ros2Environment("zenoh", domain_id, router=parts.netloc)
    return Ros2Environment("rclpy" if kind == "rclpy" else "dds", domain_id, interfaces)


def _unknown_connection(via: str) -> BridgeError:
    return BridgeError(f"'{via}' is not a graph connection; use {CONNECTION_FORMS}")


def _own_name(name: str) -> str:
    """Returns a unique node name: a ROS 1 master ends the older of two nodes with one name."""
    import os

    return f"{name}_{os.getpid()}"
