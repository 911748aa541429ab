"""What the server keeps of a station and of a connection."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from volery.comms.protocol import StationFrameParser
from volery.comms.server.mailbox import StationQueue
from volery.comms.server.rate import RateLimit


@dataclass(slots=True)
class StationRecord:
    """A station that has been here, or is expected."""

    address: int
    mailbox: StationQueue
    rate: RateLimit
    name: str = ""
    connection: int | None = None
    appeared: bool = False
    is_gone: bool = False
    """Whether it has been away for so long that sensing for many is not meant for it."""
    left_ns: int = 0
    """When its connection ended."""
    session: int = 0
    last: int = 0
    """Highest sequence that came of this session."""
    unsettled: dict[int, int] = field(default_factory=dict)
    """Sequence of this session: how many stations have not told yet that it came."""
    settled: list[int] = field(default_factory=list)
    """Sequences that it has not been told of."""
    control: deque[bytes] = field(default_factory=lambda: deque(maxlen=4096))
    """Refusals for it; also while it is away."""


@dataclass(slots=True)
class StationConnection:
    """A connection, identified or not."""

    opened_ns: int
    heard_ns: int
    station: StationRecord | None = None
    parser: StationFrameParser = field(default_factory=StationFrameParser)
    control: list[bytes] = field(default_factory=list)
    is_held: bool = False
    """Whether what it has sent waits elsewhere."""
    closing: bool = False
    """To be ended when what is said has been sent."""
