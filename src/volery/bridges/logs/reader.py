"""Summarizes a log: topics, types, counts, times; also for a truncated file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.bridges.logs.file_index import bag_index, mcap_index
from volery.bridges.logs.records import LogWalk, log_format
from volery.core.clock import NS_PER_S


@dataclass(frozen=True)
class TopicSummary:
    """One topic of a log."""

    topic: str
    msgtype: str
    messages: int
    rate_hz: float
    """Mean over the log's duration."""


@dataclass(frozen=True)
class LogSummary:
    """Contents of a log; `problem` is empty for a whole file."""

    path: Path
    format: str
    size_bytes: int
    start_ns: int
    end_ns: int
    messages: int
    topics: tuple[TopicSummary, ...]
    problem: str = ""

    @property
    def duration_s(self) -> float:
        """Simulated seconds between the first message and the last."""
        return (self.end_ns - self.start_ns) / NS_PER_S


def summarize(path: str | Path) -> LogSummary:
    """Summarizes a log, from its index or, without one, chunk by chunk.

    Raises
    ------
    RecordingError
        The file cannot be read, is no log, or exceeds the limits of a log.

    """
    path = Path(path)
    kind = log_format(path)
    counts: dict[tuple[str, str], int] = {}
    indexed = (mcap_index if kind == "mcap" else bag_index)(path, counts)
    problem = ""
    if indexed is None:
        counts.clear()
        walk = LogWalk(path)
        first, last = -1, 0
        for record in walk:
            key = (record.topic.topic, record.topic.msgtype)
            counts[key] = counts.get(key, 0) + 1
            first = record.time_ns if first < 0 else min(first, record.time_ns)
            last = max(last, record.time_ns)
        problem = walk.problem
        indexed = (max(first, 0), last)
    start, end = indexed
    seconds = (end - start) / NS_PER_S
    topics = tuple(
        TopicSummary(topic, msgtype, count, max(count - 1, 0) / seconds if seconds > 0.0 else 0.0)
        for (topic, msgtype), count in sorted(counts.items())
    )
    size = path.stat().st_size
    return LogSummary(path, kind, size, start, end, sum(counts.values()), topics, problem)
