"""A zenoh session as rmw_zenoh configures it: a peer of the router of this machine.

rmw_zenoh wants a router, which tells peers of each other. Where none answers at its usual place on
this machine, the session becomes one itself, so that nothing else needs to be started.
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
    """A session, and where it is, for people. router: HOST:PORT; empty: that of this machine.

    Raises
    ------
    BridgeError
        The router that was named does not answer.

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
    """Whether somebody listens there."""
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _GLANCE_S):
            return True
    except (OSError, ValueError):
        return False
