"""Records of the server on stations and connections."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from volery.comms.protocol import StationFrameParser
from volery.comms.server.rate import RateLimit
from volery.comms.server.station_queue import StationQueue


@dataclass(slots=True)
class StationRecord:
    """A station that has connected, or is expected."""

    address: int
    queue: StationQueue
    rate: RateLimit
    name: str = ""
    connection: int | None = None
    appeared: bool = False
    is_gone: bool = False
    """Whether it has been away for so long that sensing for many is not stored for it."""
    left_ns: int = 0
    """End of its last connection, ns."""
    session: int = 0
    last: int = 0
    """Highest received sequence of this session."""
    unsettled: dict[int, int] = field(default_factory=dict)
    """Sequence of this session to the number of receivers that have not acknowledged it."""
    settled: list[int] = field(default_factory=list)
    """Settled sequences that are not sent yet."""
    control: deque[bytes] = field(default_factory=lambda: deque(maxlen=4096))
    """Refusals for it, also while it is away."""


@dataclass(slots=True)
class StationConnection:
    """A connection, identified or not."""

    opened_ns: int
    received_ns: int
    station: StationRecord | None = None
    parser: StationFrameParser = field(default_factory=StationFrameParser)
    control: list[bytes] = field(default_factory=list)
    is_held: bool = False
    """Whether its data waits for the token check."""
    closing: bool = False
    """Whether it ends once pending data has been sent."""
