"""Serves MAVLink over UDP, as PX4's simulations do: `bridges.open(MavlinkUdp())`.

UAVs without an autopilot are ignored; see `volery.mavlink.scenario_setup`.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket

from volery.core.errors import BridgeError
from volery.core.network_access import LOOPBACK, check_address
from volery.graph.session import Gateway
from volery.mavlink.autopilot.messages.streams import GROUND, ONBOARD
from volery.mavlink.codec import dialect
from volery.mavlink.framing import Framer, lengths_of
from volery.mavlink.links import ports
from volery.mavlink.links.connection import why_not
from volery.mavlink.links.rate_limits import RateAccount, RateLimits
from volery.mavlink.links.signing import signing_of
from volery.mavlink.links.udp_reader import UdpReader, connected_socket
from volery.mavlink.links.vehicle_registry import Sink, VehicleRegistry

_MAX_VEHICLES_WITH_PEERS = 64
"""Vehicles whose configured peers have their own sockets; peers of further vehicles share one."""
_MAX_DATAGRAM_BYTES = 1400
"""Largest datagram, bytes: below the MTU of Ethernet."""


class MavlinkUdp:
    """Opens two links per vehicle: to a companion computer and to a ground station.

    host: their address. port: of the first companion computer, 14540; the others follow. The
    vehicles' own ports shift by the same offset, so that several runs can coexist. Vehicles send
    from the start, to the configured ports and to the last sender. key: 32 bytes, with which both
    sides sign; see `signing`.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = ports.ONBOARD_TO,
        *,
        ground_port: int | None = None,
        anywhere: bool = False,
        key: bytes | None = None,
    ) -> None:
        self._key = key
        self._host = host
        self._shift = port - ports.ONBOARD_TO
        self._ground = ports.GROUND_TO + self._shift if ground_port is None else ground_port
        self._anywhere = anywhere
        self._intake = RateLimits()
        self._links: dict[int, list[_UdpLink]] = {}
        self._fleet: VehicleRegistry | None = None
        self._looks: asyncio.Task[None] | None = None

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        onboard = ports.ONBOARD_TO + self._shift
        return f"MAVLink UDP {self._host}:{onboard} and following, {self._ground}"

    async def start(self, gateway: Gateway) -> None:
        """Starts to send. Raises `BridgeError` if a port is taken."""
        dialect()
        check_address(self._host, anywhere=self._anywhere, flag="--allow-remote")
        self._fleet = VehicleRegistry(gateway, self.name, self._join, self._leave)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.look_periodically())

    async def stop(self) -> None:
        """Closes all ports."""
        if self._looks is not None:
            self._looks.cancel()
            await asyncio.gather(self._looks, return_exceptions=True)
        for system in tuple(self._links):
            self._leave(system)
        if self._fleet is not None:
            self._fleet.close()

    def _join(self, name: str, system: int) -> Sink:
        assert self._fleet is not None
        self._intake.fit(len(self._fleet.systems))
        k = ports.number_of(system) + self._shift
        links = [
            (ports.ONBOARD_FROM + k, ports.ONBOARD_TO + k, ONBOARD),
            (ports.GROUND_FROM + k, self._ground, GROUND),
        ]
        opened: list[_UdpLink] = []
        try:
            for own, to, profile in links:
                opened.append(
                    _UdpLink(
                        self._fleet,
                        system,
                        profile,
                        own,
                        (self._host, to),
                        self._key,
                        self._intake,
                        for_peer=len(self._links) < _MAX_VEHICLES_WITH_PEERS,
                    )
                )
        except BridgeError as error:
            for link in opened:
                link.close()
            raise BridgeError(f"{name}: {error}") from None
        self._links[system] = opened

        def sink(number: int, data: bytes) -> None:
            for link in opened:
                if number in (-1, link.number):
                    link.send(data)

        return sink

    def _leave(self, system: int) -> None:
        for link in self._links.pop(system, ()):
            link.close()


class _UdpLink:
    """One port of one vehicle; the port is the link's number.

    for_peer: whether the peer at `to` has its own socket.
    """

    def __init__(
        self,
        fleet: VehicleRegistry,
        system: int,
        profile: int,
        own: int,
        to: tuple[str, int],
        key: bytes | None,
        intake: RateLimits,
        *,
        for_peer: bool,
    ) -> None:
        self.number = own
        self._intake = intake
        self._fleet, self._system, self._profile = fleet, system, profile
        self._peers = [to]
        self._framer = Framer()
        self._signing = signing_of(key, profile)
        family = socket.AF_INET6 if ":" in to[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((to[0] if to[0] in LOOPBACK else "", own))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise BridgeError(f"cannot listen on UDP port {own}: {why_not(error)}") from None
        connected = connected_socket(self._socket, to) if for_peer else None
        self._inlets = [self._read_from(sock) for sock in (self._socket, connected) if sock]
        fleet.send(system, own, profile, b"")

    def send(self, data: bytes) -> None:
        """Sends frames; without a receiver they are lost, as by radio."""
        data = self._signing.sign(data)
        for peer in self._peers:
            for part in _pieces(data):
                with contextlib.suppress(OSError):
                    self._socket.sendto(part, peer)

    def close(self) -> None:
        """Closes the port."""
        for inlet in self._inlets:
            inlet.close()
        self._fleet.close_link(self._system, self.number)

    def _read_from(self, sock: socket.socket) -> UdpReader:
        def deliver(frames: bytes) -> None:
            self._fleet.send(self._system, self.number, self._profile, frames)

        account = self._intake.account()
        return UdpReader(sock, account, self._take, deliver, lambda: self._fleet.pause_s)

    def _take(
        self, data: bytes, peer: tuple[str, int], account: RateAccount
    ) -> tuple[bytes, float]:
        """Returns the frames of a datagram, and for how many seconds none must be read after it."""
        received = self._framer.datagram(data)
        accepted = (frame for frame in received if self._signing.accepts(frame, self._system))
        frames = b"".join(frame.data for frame in accepted)
        noise_bytes = len(data) - sum(len(frame.data) for frame in received)
        cost_s = account.charge(max(1, len(received)), noise_bytes)
        pause_s = max(cost_s, self._fleet.pause_s)
        if self._signing.has_key and not frames:  # unknown sender
            return b"", pause_s
        if peer not in self._peers:  # the configured peer, and the last sender
            self._peers = [self._peers[0], peer[:2]]
        return frames, pause_s


def _pieces(data: bytes) -> list[bytes]:
    """Splits frames into datagrams without cutting a frame."""
    if len(data) <= _MAX_DATAGRAM_BYTES:
        return [data]
    pieces, start, at = [], 0, 0
    for length in lengths_of(data):
        if at + length - start > _MAX_DATAGRAM_BYTES and at > start:
            pieces.append(data[start:at])
            start = at
        at += length
    pieces.append(data[start:])
    return pieces
