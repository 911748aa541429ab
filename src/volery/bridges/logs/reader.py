"""What is in a log: topics, types, counts, times; also of a file that a killed run left."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.bridges.logs.records import MCAP_MAGIC, LogWalk, log_format
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
    """Contents of a log; `trouble` is empty for a whole file."""

    path: Path
    format: str
    size_bytes: int
    start_ns: int
    end_ns: int
    messages: int
    topics: tuple[TopicSummary, ...]
    trouble: str = ""

    @property
    def duration_s(self) -> float:
        """Simulated seconds between the first message and the last."""
        return (self.end_ns - self.start_ns) / NS_PER_S


def summarize(path: str | Path) -> LogSummary:
    """Look into a log, through its index or, where that is missing, chunk by chunk.

    Raises
    ------
    RecordingError
        The file cannot be read or is no log.

    """
    path = Path(path)
    kind = log_format(path)
    counts: dict[tuple[str, str], int] = {}
    indexed = (_mcap_index if kind == "mcap" else _bag_index)(path, counts)
    trouble = ""
    if indexed is None:
        counts.clear()
        walk = LogWalk(path)
        first, last = -1, 0
        for record in walk:
            key = (record.topic.topic, record.topic.msgtype)
            counts[key] = counts.get(key, 0) + 1
            first = record.time_ns if first < 0 else min(first, record.time_ns)
            last = max(last, record.time_ns)
        trouble = walk.trouble
        indexed = (max(first, 0), last)
    start, end = indexed
    seconds = (end - start) / NS_PER_S
    topics = tuple(
        TopicSummary(topic, msgtype, count, max(count - 1, 0) / seconds if seconds > 0.0 else 0.0)
        for (topic, msgtype), count in sorted(counts.items())
    )
    size = path.stat().st_size
    return LogSummary(path, kind, size, start, end, sum(counts.values()), topics, trouble)


def _mcap_index(path: Path, counts: dict[tuple[str, str], int]) -> tuple[int, int] | None:
    """First and last time, and counts by topic, from an MCAP's summary; None without one."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        file.seek(0, 2)
        if file.tell() < 2 * len(MCAP_MAGIC):
            return None
        file.seek(-len(MCAP_MAGIC), 2)
        if file.read() != MCAP_MAGIC:
            return None
        file.seek(0)
        try:
            summary = make_reader(file).get_summary()
        except Exception:  # whatever the reader makes of damaged bytes
            return None
    if summary is None or summary.statistics is None:
        return None
    numbers = summary.statistics
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
        key = (channel.topic, schema.name if schema else "")
        counts[key] = counts.get(key, 0) + numbers.channel_message_counts.get(channel.id, 0)
    return numbers.message_start_time, numbers.message_end_time


def _bag_index(path: Path, counts: dict[tuple[str, str], int]) -> tuple[int, int] | None:
    """The same from a bag's index."""
    from rosbags.rosbag1 import Reader

    try:
        with Reader(path) as reader:
            for connection in reader.connections:
                key = (connection.topic, connection.msgtype)
                counts[key] = counts.get(key, 0) + connection.msgcount
            if not reader.chunk_infos:
                return 0, 0
            return reader.start_time, reader.end_time - 1  # rosbags' end is exclusive
    except Exception:  # whatever the reader makes of damaged bytes
        return None
