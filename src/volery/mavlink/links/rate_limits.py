"""Limits the rate at which clients of a MAVLink port may send.

Each frame takes time of the port's thread and of the simulation. A client has an account of frames
that fills at a rate. While the account is overdrawn, nothing is read from the client, so TCP slows
the client down and UDP loses what does not fit. Clients that overdraw at the same time share one
rate; other clients are not affected.
"""

from __future__ import annotations

import time
from collections.abc import Callable

FRAMES_PER_S = 400.0
"""Rate shared by all clients of a port that exceed their account; a frame for three vehicles counts
as three (modelling choice)."""
_FRAMES_PER_S_AND_VEHICLE = 20.0
"""Minimum rate per vehicle: setpoints for all vehicles of a large swarm over one connection."""
_BURST_FRAMES = 500.0
"""Size of an account: a mission of many waypoints, all parameters."""
_MIN_PAUSE_S = 0.05
"""Shortest pause of an overdrawn client, so that few long turns read it, not one turn per frame."""
_BYTES_PER_NOISE = 24
"""Bytes outside frames that cost as much as a frame: each is a possible start of one."""


class RateLimits:
    """Holds the limits that the clients of one port share."""

    def __init__(
        self, frames_per_s: float = FRAMES_PER_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.clock = clock
        self._frames_per_s = frames_per_s
        self._overdrawn: set[RateAccount] = set()

    def fit(self, num_vehicles: int) -> None:
        """Sets the rate for a number of vehicles."""
        self._frames_per_s = max(FRAMES_PER_S, _FRAMES_PER_S_AND_VEHICLE * num_vehicles)

    @property
    def rate(self) -> float:
        """Current rate of one client, frames per second."""
        return self._frames_per_s / max(1, len(self._overdrawn))

    def account(self) -> RateAccount:
        """Returns the account of a new client."""
        return RateAccount(self)

    def note(self, account: RateAccount, *, is_overdrawn: bool) -> None:
        """Adds a client to or removes it from the clients that send too much."""
        if is_overdrawn:
            self._overdrawn.add(account)
        else:
            self._overdrawn.discard(account)


class RateAccount:
    """One client's account."""

    def __init__(self, limits: RateLimits) -> None:
        self._limits = limits
        self._frames = _BURST_FRAMES
        self._at_s = limits.clock()

    def charge(self, num_frames: int = 0, noise_bytes: int = 0) -> float:
        """Returns for how many seconds nothing must be read from the client that has sent this.

        noise_bytes: bytes outside frames. Call it again, without arguments, after that time.
        """
        now_s = self._limits.clock()
        filled = self._frames + (now_s - self._at_s) * self._limits.rate
        cost = num_frames + max(0, noise_bytes) / _BYTES_PER_NOISE
        self._at_s, self._frames = now_s, min(_BURST_FRAMES, filled) - cost
        self._limits.note(self, is_overdrawn=self._frames < 0.0)
        if self._frames >= 0.0:
            return 0.0
        return max(_MIN_PAUSE_S, -self._frames / self._limits.rate)

    def close(self) -> None:
        """Removes the client."""
        self._limits.note(self, is_overdrawn=False)
