"""Where `volery node`, `volery topic` and `volery service` find their graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.graph.link import Link


DEFAULT_VIA = "rosbridge://127.0.0.1:9090"
_WAYS = "rosbridge://HOST:PORT or ros1"


def open_link(via: str, name: str) -> Link:
    """Join the graph at `via` under a name. `BridgeError` where nobody answers there."""
    scheme, _, rest = via.partition("://")
    if scheme in ("rosbridge", "ws", "wss"):
        from volery.bridges.rosbridge.client import RosbridgeClient

        url = via if scheme != "rosbridge" else f"ws://{rest}"
        return RosbridgeClient(url, name=name)
    if scheme == "ros1":
        from volery.bridges.ros1.client import Ros1Client

        return Ros1Client(f"http://{rest}" if rest else None, _ros1_name(name))
    raise BridgeError(f"'{via}' is no way into a graph; use {_WAYS}")


def _ros1_name(name: str) -> str:
    """A node name of its own: a ROS 1 master ends the older of two nodes of one name."""
    import os

    return f"{name}_{os.getpid()}"
