"""Reads messages of any log: MCAP, ROS 1 bag, ROS 2 bag, or a LIDAR's text log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.records import LogWalk, file_signature, log_format
from volery.bridges.logs.ros2_bags import BagWalk, bag_topics
from volery.bridges.logs.text_layout import TextLayout
from volery.bridges.logs.text_scans import TextScans
from volery.core.errors import GraphError, RecordingError
from volery.core.plurals import counted


class SlamInput(NamedTuple):
    """Describes a message of a log."""

    topic: str
    time_ns: int
    message: Any


@dataclass
class LogSource:
    """Reads a log of typed messages; afterwards `problem` describes any damage."""

    path: Path
    topics: dict[str, str]
    """Message types by topic."""
    problem: str = ""
    refused: int = 0
    """Number of messages that cannot be decoded."""
    damage: str = ""
    """Damage that is visible without reading the messages."""
    warnings: tuple[str, ...] = ()
    _walk: Any = field(default=None, repr=False)

    def messages(self, wanted: set[str]) -> Iterator[SlamInput]:
        """Yields the messages of the topics `wanted` in the order of the file."""
        decoder = LogDecoder()
        walk = self._walk(self.path)
        for record in walk:
            if record.topic.topic not in wanted:
                continue
            try:
                message = decoder.decode(record).message
            except GraphError as error:
                self.refused += 1
                self.problem = self.problem or f"{record.topic.topic}: {error}"
                continue
            yield SlamInput(record.topic.topic, record.time_ns, message)
        self.problem = self.problem or getattr(walk, "problem", "")


@dataclass
class TextSource:
    """Reads a LIDAR's text log; its topics are those that `volery convert` writes."""

    path: Path
    layout: TextLayout
    problem: str = ""
    refused: int = 0
    """Number of lines left out."""
    damage: str = ""
    warnings: list[str] = field(default_factory=list)
    """Possible errors of the layout."""

    @property
    def topics(self) -> dict[str, str]:
        """Message types by topic."""
        uav = f"/{self.layout.uav}"
        found = {
            f"{uav}/{self.layout.topic}": "sensor_msgs/msg/LaserScan",
            "/tf_static": "tf2_msgs/msg/TFMessage",
        }
        if self.layout.odometry or self.layout.wheels:
            found[f"{uav}/odom"] = "nav_msgs/msg/Odometry"
        return found

    def messages(self, wanted: set[str]) -> Iterator[SlamInput]:
        """Yields the messages of the topics `wanted` in the order of the lines."""
        scans = TextScans(self.path, self.layout)
        for published in scans:
            if published.topic in wanted:
                yield SlamInput(published.topic, published.time_ns, published.message)
        self.refused, self.warnings = scans.left_out, scans.warnings
        if scans.left_out:
            self.problem = f"{counted(scans.left_out, 'line')} left out; {scans.problem}"


def open_source(path: Path, layout: TextLayout | None = None) -> LogSource | TextSource:
    """Opens the log at a path, as text if a layout is given.

    Raises
    ------
    RecordingError
        The log does not exist or has an unknown format.

    """
    if layout is not None:
        return TextSource(path, layout)
    if path.is_dir() or file_signature(path) in ("sqlite", "zstd"):
        return LogSource(path, bag_topics(path), _walk=BagWalk)
    try:
        log_format(path, "a ROS 2 bag")
    except RecordingError as error:
        if not path.is_file() or path.suffix in (".mcap", ".bag") or path.stat().st_size == 0:
            raise
        raise RecordingError(f"{error}; a scanner's text log needs --layout") from None
    summary = summarize(path)
    topics = {t.topic: t.msgtype for t in summary.topics}
    return LogSource(path, topics, damage=summary.problem, _walk=LogWalk)
