"""Opens a zenoh session as configured by rmw_zenoh: a peer of the router of this machine.

rmw_zenoh needs a router, which connects peers. If no router answers at the default address of this
machine, the session becomes the router itself, so that nothing else needs to be started.
"""

from __future__ import annotations

import json
import socket
from typing import Any

import zenoh

from volery.core.errors import BridgeError

DEFAULT_ROUTER = "localhost:7447"
_GLANCE_S = 0.5


def open_session(router: str) -> tuple[Any, str]:
    """Returns a session and its address as text. router: HOST:PORT; empty: this machine's.

    Raises
    ------
    BridgeError
        The given router does not answer.

    """
    address = router or DEFAULT_ROUTER
    there = _answers(address)
    if router and not there:
        raise BridgeError(f"no zenoh router answers at {router}")
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "peer" if there else "router",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "timestamping/enabled": {"router": True, "peer": True, "client": True},
    }
    if there:
        settings["connect/endpoints"] = [f"tcp/{address}"]
        settings["listen/endpoints"] = ["tcp/localhost:0"]
    else:
        settings["listen/endpoints"] = [f"tcp/{address}"]
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise BridgeError(f"cannot join zenoh at {address}: {error}") from None
    return session, f"zenoh router {address}" if there else f"zenoh, as the router at {address}"


def _answers(address: str) -> bool:
    """Returns whether a server listens at an address."""
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _GLANCE_S):
            return True
    except (OSError, ValueError):
        return False
