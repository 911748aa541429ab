"""Summarizes logs of every format: topics, types, counts, times."""

from __future__ import annotations

from pathlib import Path

from volery.bridges.logs.bag_files import bag_size
from volery.bridges.logs.reader import LogSummary, TopicSummary, summarize
from volery.core.clock import NS_PER_S
from volery.logs.sources import log_kind, open_source


def summarize_log(path: Path) -> LogSummary:
    """Summarizes a log as `summarize`, and also ROS 2 bags (`ros2bag`) and ULog (`ulog`).

    Raises `RecordingError` if the file cannot be read, is no log, or exceeds the limits of logs.
    """
    kind = log_kind(path)
    if kind in ("mcap", "bag"):
        return summarize(path)
    source = open_source(path)
    try:
        seconds = (source.end_ns - source.start_ns) / NS_PER_S
        topics = tuple(
            TopicSummary(
                name,
                count.msgtype,
                count.messages,
                max(count.messages - 1, 0) / seconds if seconds > 0.0 else 0.0,
            )
            for name, count in source.topics.items()
        )
        messages = sum(topic.messages for topic in topics)
        return LogSummary(
            path, kind, bag_size(path), source.start_ns, source.end_ns, messages, topics,
            source.problem,
        )  # fmt: skip
    finally:
        source.close()
