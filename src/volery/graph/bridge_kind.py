"""Defines bridges, and how a package registers one under a name.

    KIND = BridgeKind(port=9100, make=_make)

    def _make(address: Address, options: BridgeOptions) -> Bridge:
        from my_package.server import MyServer      # late: registration imports nothing

        return MyServer(*address, allow_remote=options.allow_remote)

An entry point of the group `volery.bridges` names it; see `volery.bridges.bridge_factory`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from pathlib import Path

    from volery.graph.session import Gateway

LOOPBACK = "127.0.0.1"
NO_PORT = -1
"""The default port of a kind that needs to know whether a port was given."""


class Bridge(Protocol):
    """Connects other programs to the graph."""

    @property
    def name(self) -> str:
        """Name and address of the bridge for users: `ROS-TCP 127.0.0.1:10000`."""

    async def start(self, gateway: Gateway) -> None:
        """Starts to serve, or to connect. Raises `BridgeError` if that is not possible."""

    async def stop(self) -> None:
        """Disconnects all clients and frees everything; also after a start that failed."""


class Address(NamedTuple):
    """Address to listen on or to connect to; for a serial line: its path and baud rate."""

    host: str
    port: int


@dataclass(frozen=True, kw_only=True)
class BridgeOptions:
    """Options of a run's bridges; each bridge uses its own."""

    allow_remote: bool = False
    """Whether bridges may listen beyond loopback."""
    token: str | None = None
    """Token that clients must send, if the protocol supports one."""
    origins: tuple[str, ...] = ()
    """Web origins whose pages are accepted besides this machine's; `null`: pages from files."""
    report: Callable[[str], None] | None = None
    """Receives lines for users, from any thread: connections begin or end. None: logged."""
    domain_id: int | None = None
    """ROS 2 domain; None: that of ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces for ROS 2 over DDS; empty: this machine only."""
    mavlink_key: Path | None = None
    """File with the text that signs MAVLink; None: frames are not signed."""
    autopilot_timeout_s: float = 10.0
    """Wall time that an external autopilot in lock step may be silent ..."""
    drop_on_timeout: bool = False
    """... and whether the run then continues without it; else the run ends with an error."""
    reports_missing_autopilots: bool = True
    """Whether bridges log autopilots that do not connect; False: the caller reports them."""


class BridgeKind(NamedTuple):
    """A kind of bridge, created by name.

    port: default port; for a serial line: default baud rate. make: creates the bridge, and imports
    its dependencies only then. is_serial: the address is PATH[:BAUD], not [HOST:]PORT.
    """

    port: int
    make: Callable[[Address, BridgeOptions], Bridge]
    is_serial: bool = False
