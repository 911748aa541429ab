"""Where `volery node`, `volery topic` and `volery service` find their graph."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import typer

from volery.core.errors import BridgeError, UnreachableError

if TYPE_CHECKING:
    from volery.bridges.nodes.deferred_connection import DeferredConnection
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.ros2.environment import Ros2Environment
    from volery.graph.connection import GraphConnection


DEFAULT_VIA = "rosbridge://127.0.0.1:9090"
WAYS = "rosbridge://HOST:PORT, ros-tcp://HOST:PORT, ros1, ros2, ros2-zenoh or rclpy"
ROS2_WAYS = ("ros2", "ros2-zenoh", "rclpy")
_ROS_TCP_PORT = 10000
PATIENCE_S = 30.0
"""So long nodes in processes of their own wait for their graph; a world takes a while to build."""
_AGAIN_S = 0.2


def open_link(via: str, name: str) -> GraphConnection:
    """Join the graph at `via` under a name. `BridgeError` where nobody answers there."""
    scheme, _, rest = via.partition("://")
    if scheme in ("rosbridge", "ws", "wss"):
        from volery.bridges.rosbridge.client import RosbridgeClient

        url = via if scheme != "rosbridge" else f"ws://{rest}"
        return RosbridgeClient(url, name=name)
    if scheme in ("ros-tcp", "ros-tcp-2"):
        from volery.bridges.ros_tcp.client import RosTcpClient

        host, port = _address(via, _ROS_TCP_PORT)
        return RosTcpClient(
            host, port, name=name, generation="ros2" if scheme == "ros-tcp-2" else "ros1"
        )
    if scheme == "ros1":
        from volery.bridges.ros1.client import Ros1Client

        return Ros1Client(f"http://{rest}" if rest else None, _own_name(name))
    if scheme in ROS2_WAYS:
        from volery.bridges.ros2.client import Ros2Client

        return Ros2Client(_ros2_terms(via), f"/{_own_name(name)}")
    raise _no_way(via)


def await_link(via: str, name: str, patience_s: float = PATIENCE_S) -> GraphConnection:
    """As `open_link`, for programs that may be started before the graph: waits, and says so."""
    until = time.monotonic() + patience_s
    told = False
    while True:
        try:
            return open_link(via, name)
        except UnreachableError as error:
            if time.monotonic() >= until:
                raise
            if not told:
                told = True
                typer.echo(f"{error}; waits {patience_s:.0f} s for it", err=True)
            time.sleep(_AGAIN_S)


def join_late(late: DeferredConnection, host: NodeHost) -> GraphConnection:
    """Join the graph of nodes that are there already; their timers count from then on."""
    before_ns = host.now_ns()
    link = late.join()
    host.postpone(host.now_ns() - before_ns)
    return link


class ConnectionOptions:
    """Says when a link's connection breaks, and when it is back; ask it again and again.

    For `NodeHost.spin` it is an end that never comes.
    """

    def __init__(self, link: GraphConnection, via: str) -> None:
        self._link = link
        self._via = via
        self._was = True

    def __call__(self) -> bool:
        """Say what has changed."""
        connected = getattr(self._link, "connected", True)
        if connected != self._was:
            self._was = connected
            what = "is there again" if connected else "is gone; waiting for it"
            typer.echo(f"the graph at {self._via} {what}", err=True)
        return False


def _ros2_terms(via: str) -> Ros2Environment:
    """Of `ros2://DOMAIN?interface=NAME`, `ros2-zenoh://HOST:PORT?domain=DOMAIN`, `rclpy://DOMAIN`."""
    from volery.bridges.ros2.environment import Ros2Environment

    parts = urlsplit(via)
    asked = parse_qs(parts.query, keep_blank_values=True)
    kind = via.partition("://")[0]
    zenoh = kind == "ros2-zenoh"
    domain = asked.pop("domain", [""])[-1] if zenoh else parts.netloc
    interfaces = tuple(asked.pop("interface", ())) if kind == "ros2" else ()
    if asked:
        known = {"ros2": "interface", "ros2-zenoh": "domain"}.get(kind)
        hint = f"{kind} knows {known}" if known else f"{kind} has no options"
        raise BridgeError(f"'{via}': there is no option '{next(iter(asked))}'; {hint}")
    if parts.path.strip("/") not in ("", kind) or parts.fragment:
        raise _no_way(via)
    if domain and not domain.isdecimal():
        raise BridgeError(f"'{via}': a domain is a number from 0 to 232, not '{domain}'")
    domain_id = int(domain) if domain else None
    if zenoh:
        return Ros2Environment("zenoh", domain_id, router=parts.netloc)
    return Ros2Environment("rclpy" if kind == "rclpy" else "dds", domain_id, interfaces)


def _address(via: str, port: int) -> tuple[str, int]:
    """Host and port of a way into a graph. `BridgeError` for what is none."""
    try:
        parts = urlsplit(via)
        host, given = parts.hostname, parts.port
    except ValueError:
        raise _no_way(via) from None
    if host is None or given == 0 or parts.path.strip("/"):
        raise _no_way(via)
    return host, given or port


def _no_way(via: str) -> BridgeError:
    return BridgeError(f"'{via}' is no way into a graph; use {WAYS}")


def _own_name(name: str) -> str:
    """A node name of its own: a ROS 1 master ends the older of two nodes of one name."""
    import os

    return f"{name}_{os.getpid()}"
