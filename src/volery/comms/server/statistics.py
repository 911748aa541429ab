"""Counters of the communication server."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from volery.comms.control_payloads import Reason
from volery.comms.protocol import StationFrameParser
from volery.core.framing import Flaw


@dataclass(frozen=True)
class Statistics:
    """Counts since the start; messages to many count once for each station unless noted."""

    accepted: int
    """Messages from stations, once each."""
    delivered: int
    """Messages acknowledged by their stations."""
    stored: int
    """Messages stored for a station that was away."""
    duplicates: int
    """Messages that a source repeated though the server had them."""
    dropped_sensing: int
    """Measurements dropped for newer ones."""
    flooded: int
    """Measurements above the allowed rate."""
    expired: int
    """Messages that waited for too long."""
    lost_on_link: int
    """Messages that the radio model lost."""
    refused: Mapping[Reason, int]
    """Refusals by reason, including those of connections."""
    corrupt: Mapping[Flaw, int]
    """Damaged frames by flaw."""
    noise_bytes: int
    """Bytes outside of frames."""
    unexpected: int
    """Valid frames that a station should not send."""
    silent: int
    """Connections closed because no data, or no HELLO, arrived in time."""
    replaced: int
    """Connections replaced by a new one of the same station."""
    connections: int
    """Open connections."""
    present: int
    """Connected stations."""
    away: int
    """Known stations that are not connected."""
    waiting: int
    """Messages that wait or are in transit."""


class Tally:
    """Counters; `statistics` returns their values."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: Counter[Reason] = Counter()
        self.corrupt: Counter[Flaw] = Counter()

    def add(self, parser: StationFrameParser) -> None:
        """Adds the counts of a connection that has ended."""
        self.corrupt.update(parser.flaws)
        self.counts["noise_bytes"] += parser.noise_bytes

    def statistics(
        self, parsers: Sequence[StationFrameParser], present: int, away: int, waiting: int
    ) -> Statistics:
        """Returns the statistics. parsers: of the open connections."""
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
