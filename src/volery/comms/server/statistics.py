"""What the communication server counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from volery.comms.control_payloads import Reason
from volery.comms.protocol import StationFrameParser
from volery.core.framing import Flaw


@dataclass(frozen=True)
class Statistics:
    """Counts since the start; messages to many count once for each station where not said."""

    accepted: int
    """Messages that came from stations, once each."""
    delivered: int
    """Told by the station to have come."""
    stored: int
    """Kept for a station that was away."""
    duplicates: int
    """Sent again by a source though the server had them."""
    dropped_sensing: int
    """Measurements that had to go for newer ones."""
    flooded: int
    """Measurements above the rate that is allowed."""
    expired: int
    """Messages that waited for too long."""
    lost_on_link: int
    """Messages that the radio model lost."""
    refused: Mapping[Reason, int]
    """Refusals by reason, those of connections included."""
    corrupt: Mapping[Flaw, int]
    """Damaged frames by what is wrong."""
    noise_bytes: int
    """Bytes that belonged to no frame."""
    unexpected: int
    """Whole frames that a station has no reason to send."""
    silent: int
    """Connections ended because nothing, or no HELLO, came."""
    replaced: int
    """Connections ended because the same station came anew."""
    connections: int
    """Now open."""
    present: int
    """Stations connected now."""
    away: int
    """Stations known and not connected."""
    waiting: int
    """Messages that wait or are on their way now."""


class Tally:
    """Counts that go on; `statistics` takes a picture of them."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: Counter[Reason] = Counter()
        self.corrupt: Counter[Flaw] = Counter()

    def add(self, parser: StationFrameParser) -> None:
        """Keep the counts of a connection that has ended."""
        self.corrupt.update(parser.flaws)
        self.counts["noise_bytes"] += parser.noise_bytes

    def statistics(
        self, parsers: Sequence[StationFrameParser], present: int, away: int, waiting: int
    ) -> Statistics:
        """The counts and how things stand. parsers: of the open connections."""
        count = self.counts
        corrupt = sum((parser.flaws for parser in parsers), self.corrupt)
        noise_bytes = sum(parser.noise_bytes for parser in parsers)
        return Statistics(
            accepted=count["accepted"],
            delivered=count["delivered"],
            stored=count["stored"],
            duplicates=count["duplicates"],
            dropped_sensing=count["dropped_sensing"],
            flooded=count["flooded"],
            expired=count["expired"],
            lost_on_link=count["lost_on_link"],
            refused=dict(self.refused),
            corrupt=dict(corrupt),
            noise_bytes=count["noise_bytes"] + noise_bytes,
            unexpected=count["unexpected"],
            silent=count["silent"],
            replaced=count["replaced"],
            connections=len(parsers),
            present=present,
            away=away,
            waiting=waiting,
        )
