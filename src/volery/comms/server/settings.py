"""The rules of the communication server as numbers; times in seconds. All are modelling choices."""

from __future__ import annotations

from dataclasses import dataclass

from volery.comms.addresses import FIRST_GROUND, PLANES_PER_BATCH
from volery.core.errors import CommsError


@dataclass(frozen=True)
class RouterSettings:
    """What the server allows and for how long it waits."""

    planes_per_batch: int = PLANES_PER_BATCH
    token: str | None = None
    """What stations must show; None: nothing."""
    lane_depth: int = 1024
    """Messages of each kind that wait from one source for one station: as many as it holds."""
    mailbox_bytes: int = 8 << 20
    """Bytes that wait for one station."""
    window: int = 256
    """Messages on their way to one station that it has not yet told to have come."""
    keep_s: float = 60.0
    """For how long a message waits for its station."""
    keep_many_s: float = 5.0
    """For how long sensing to batches and to all waits for a station that is away; after that it is
    as one that nobody listens to: what a fleet told a minute ago is of no use to who comes back."""
    forget_s: float = 600.0
    """After which a station that is away is no longer known."""
    grace_s: float = 5.0
    """After the start: for so long every station counts as known, since all have to come again."""
    grace_messages: int = 4096
    """Messages to batches and to all that are kept for stations which come within that time."""
    hello_s: float = 2.0
    """Within which a connection must say who it is."""
    silence_s: float = 3.0
    """After which a station that says nothing is let go; stations ping every second."""
    rate_messages_s: float = 2000.0
    """Messages a second of one station, in the long run."""
    burst_messages: int = 4096
    """Messages at once; what a station sends again after a restart of the server fits."""
    rate_bytes_s: float = 16e6
    most_corrupt: int = 100
    """Damaged frames after which a connection is ended."""
    most_connections: int = 256

    def __post_init__(self) -> None:
        """`CommsError` for numbers that cannot be."""
        if not 1 <= self.planes_per_batch <= FIRST_GROUND:
            raise CommsError(f"a batch has 1 to {FIRST_GROUND} planes, not {self.planes_per_batch}")
        for name in ("lane_depth", "mailbox_bytes", "window", "burst_messages"):
            if getattr(self, name) < 1:
                raise CommsError(f"{name} must be at least 1, not {getattr(self, name)}")
