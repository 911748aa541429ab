"""Shared parts of MAVLink's bridges: a connection that carries all vehicles."""

from __future__ import annotations

import errno

from volery.mavlink.codec import Parser
from volery.mavlink.framing import Framer
from volery.mavlink.links.rate_limits import RateAccount
from volery.mavlink.links.signing import signing_of
from volery.mavlink.links.vehicle_registry import VehicleRegistry

_NO_SYSTEM = 0
"""Recipient of frames for a vehicle that does not exist, so that they prove a client only once."""


class MavlinkConnection:
    """One connection that carries all vehicles: a TCP client or a serial line.

    account: limits what is read; None: no limit.
    """

    def __init__(
        self,
        fleet: VehicleRegistry,
        number: int,
        profile: int,
        key: bytes | None = None,
        account: RateAccount | None = None,
    ) -> None:
        self.number = number
        self.has_received = False
        """Whether a valid frame has arrived."""
        self._account = account
        self._signing = signing_of(key, number)
        self._fleet, self._profile = fleet, profile
        self._framer, self._parser = Framer(), Parser()
        self._systems: set[int] = set()

    def greet(self, system: int) -> None:
        """Makes a vehicle send on this connection."""
        self._systems.add(system)
        self._fleet.send(system, self.number, self._profile, b"")

    def take(self, data: bytes) -> float:
        """Routes received bytes to their vehicles.

        Returns for how many seconds nothing more must be read.
        """
        frames, cost = self._framer.feed(data), 0
        parts: dict[int, list[bytes]] = {}
        for frame in filter(self._signing.is_genuine, frames):
            target = getattr(self._parser.decode(frame.data), "target_system", 0)
            addressed = self._systems if target == 0 else self._systems & {target}
            recipients = self._signing.recipients(frame, addressed or {_NO_SYSTEM})
            if not recipients:
                continue
            self.has_received = True
            chosen = addressed.intersection(recipients)
            cost += max(0, len(chosen) - 1)
            for system in chosen:
                parts.setdefault(system, []).append(frame.data)
        for system in sorted(parts):
            self._fleet.send(system, self.number, self._profile, b"".join(parts[system]))
        if self._account is None:
            return 0.0
        noise_bytes = len(data) - sum(len(frame.data) for frame in frames)
        pause_s = self._account.charge(len(frames) + cost, noise_bytes)
        return max(pause_s, self._fleet.pause_s)

    def may_read(self) -> float:
        """Returns for how many seconds more nothing must be read."""
        return 0.0 if self._account is None else max(self._account.charge(), self._fleet.pause_s)

    def sign(self, data: bytes) -> bytes:
        """Returns the frames as sent over this connection, signed if it has a key."""
        return self._signing.sign(data)

    def leave(self) -> None:
        """Removes this connection's links from the vehicles."""
        if self._account is not None:
            self._account.close()
        for system in self._systems:
            self._fleet.close_link(system, self.number)


def why_not(error: Exception) -> str:
    """Returns why a bridge cannot listen on an address."""
    taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
    return "the port is taken" if taken else str(error)
