"""What a bridge is, and how a package declares one under a name.

    KIND = BridgeKind(port=9100, make=_make)

    def _make(address: Address, options: BridgeOptions) -> Bridge:
        from my_package.server import MyServer      # late: the name alone loads nothing

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
        """Names the bridge and its address for people: `ROS-TCP 127.0.0.1:10000`."""

    async def start(self, gateway: Gateway) -> None:
        """Starts to serve, or to connect. `BridgeError` where that is not possible."""

    async def stop(self) -> None:
        """Disconnects all clients and frees everything; also after a start that failed."""


class Address(NamedTuple):
    """Where a bridge listens or connects to; of a serial line: its path and its baud rate."""

    host: str
    port: int


@dataclass(frozen=True, kw_only=True)
class BridgeOptions:
    """Options of a run's bridges; each bridge reads those that concern it."""

    allow_remote: bool = False
    """Whether bridges may listen beyond loopback."""
    token: str | None = None
    """Clients show it, where the protocol can carry it."""
    report: Callable[[str], None] | None = None
    """Receives lines for people, from any thread: connections begin or end. None: logged."""
    domain_id: int | None = None
    """ROS 2 domain; None: that of ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces for ROS 2 over DDS; none: this machine alone."""
    mavlink_key: Path | None = None
    """File with the text that signs MAVLink; None: frames are not signed."""
    autopilot_timeout_s: float = 10.0
    """Wall time that an external autopilot in lock step may be silent ..."""
    drop_on_timeout: bool = False
    """... and whether the run then continues without it; else the run ends with an error."""
    reports_missing_autopilots: bool = True
    """Whether bridges log autopilots that do not connect; False: the caller reports them."""


class BridgeKind(NamedTuple):
    """A bridge that can be made by name.

    port: used where the user gives none; of a serial line: the baud rate. make: makes the bridge,
    and imports only then what it needs. is_serial: its address is PATH[:BAUD], not [HOST:]PORT.
    """

    port: int
    make: Callable[[Address, BridgeOptions], Bridge]
    is_serial: bool = False
