"""Limits of the communication server; times in seconds. All are modelling choices."""

from __future__ import annotations

from dataclasses import dataclass

from volery.comms.addresses import FIRST_GROUND, GROUP_SIZE
from volery.core.errors import CommsError


@dataclass(frozen=True)
class RouterSettings:
    """Limits and timeouts of the server."""

    group_size: int = GROUP_SIZE
    token: str | None = None
    """Token that stations must send; None: no token."""
    lane_depth: int = 1024
    """Max waiting messages of each kind from one source for one station: a station's send
    buffer.
    """
    queue_bytes: int = 8 << 20
    """Max waiting bytes for one station."""
    window: int = 256
    """Max messages in transit to one station without acknowledgement."""
    keep_s: float = 60.0
    """Time for which a message waits for its station."""
    keep_many_s: float = 5.0
    """Time for which sensing to batches and to all waits for a station that is away; older states
    are of no use to a station that returns.
    """
    forget_s: float = 600.0
    """Time after which a station that is away is forgotten."""
    grace_s: float = 5.0
    """Time after the start in which every station counts as known, since all have to reconnect."""
    grace_messages: int = 4096
    """Max messages to batches and to all that are stored for stations that join within that
    time.
    """
    hello_s: float = 2.0
    """Time in which a connection must send HELLO."""
    silence_s: float = 3.0
    """Time without data after which a station is disconnected; stations ping every second."""
    rate_messages_s: float = 2000.0
    """Steady message rate of one station."""
    burst_messages: int = 4096
    """Burst of messages; it covers the messages that a station repeats after a restart of the
    server.
    """
    rate_bytes_s: float = 16e6
    max_corrupt: int = 100
    """Damaged frames after which a connection is closed."""
    max_connections: int = 256

    def __post_init__(self) -> None:
        """Raises CommsError for invalid values."""
        if not 1 <= self.group_size <= FIRST_GROUND:
            raise CommsError(f"a batch has 1 to {FIRST_GROUND} planes, not {self.group_size}")
        for name in ("lane_depth", "queue_bytes", "window", "burst_messages"):
            if getattr(self, name) < 1:
                raise CommsError(f"{name} must be at least 1, not {getattr(self, name)}")
