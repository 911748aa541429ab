"""A log as data: topics, columns, tables, transforms and plots."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.topic_patterns import topic_filter
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError, LogWarning, VoleryError
from volery.core.plurals import counted
from volery.logs.sources import LogSource, open_source
from volery.logs.topic_count import TopicCount
from volery.logs.topic_data import WHOLE_NS, LoggedMessage, TopicData, clipped, load_numbers
from volery.logs.trajectories import LoggedTrajectory, pose_topics, read_trajectory
from volery.logs.transforms import LoggedTransforms

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pandas
    from matplotlib.axes import Axes

_CLOSEST = 3
"""Similar topics that an error lists."""


def open_log(path: str | Path) -> Log:
    """Opens a log as data: MCAP, a ROS 1 bag, a ROS 2 bag (folder or .db3 file), or PX4's ULog.

    Truncated and damaged files are read as far as possible: a `LogWarning` and `Log.problem`
    describe the damage. Raises `RecordingError` if the file is missing, no log, a folder of several
    logs that are no parts of one bag, or exceeds the limits of logs.
    """
    path = Path(path)
    log = Log(path, open_source(path), WHOLE_NS)
    if log.problem:
        warnings.warn(f"{path}: {log.problem}", LogWarning, stacklevel=2)
    return log


class Log:
    """A log: `log["/uav1/odom"]` is a topic's data, `log.topics` lists all topics.

    A topic is read when its data are used, without the others. The file is closed by `close`, at
    the end of a `with` block, or with the last object that uses it.
    """

    def __init__(self, path: Path, source: LogSource, range_ns: tuple[int, int]) -> None:
        self.path = path
        """File or folder of the log."""
        self._source = source
        self._range_ns = range_ns
        self._data: dict[str, TopicData] = {}

    # ------------------------------------------------------------------------------------- topics

    @property
    def topics(self) -> Mapping[str, TopicCount]:
        """Types and numbers of messages in the whole log, by topic, sorted."""
        return MappingProxyType(self._source.topics)

    @property
    def start_s(self) -> float:
        """Time of the first message, s; of the first selected time after `between`."""
        return max(self._source.start_ns, self._range_ns[0]) / NS_PER_S

    @property
    def end_s(self) -> float:
        """Time of the last message, s; of the last selected time after `between`."""
        return min(self._source.end_ns, self._range_ns[1]) / NS_PER_S

    @property
    def duration_s(self) -> float:
        """Time from the first message to the last one, s."""
        return max(self.end_s - self.start_s, 0.0)

    @property
    def problem(self) -> str:
        """Problems of the file as far as it was read; empty for a whole one."""
        return self._source.problem

    @property
    def uavs(self) -> tuple[str, ...]:
        """Names of the UAVs: the namespaces of topics with poses."""
        return tuple(pose_topics(self.topics))

    def __getitem__(self, topic: str) -> TopicData:
        """Returns the data of a topic. Raises `VoleryError`, with similar names, without any."""
        if topic not in self._source.topics:
            raise VoleryError(self._unknown(topic))
        data = self._data.get(topic)
        if data is None:
            msgtype = self._source.topics[topic].msgtype
            data = TopicData(self._source, topic, msgtype, *self._range_ns)
            self._data[topic] = data
        return data

    def __contains__(self, topic: object) -> bool:
        return topic in self._source.topics

    def __iter__(self) -> Iterator[str]:
        """Iterates over the names of the topics."""
        return iter(self._source.topics)

    def __len__(self) -> int:
        """Returns the number of topics."""
        return len(self._source.topics)

    def between(self, start_s: float = 0.0, end_s: float = np.inf) -> Log:
        """Returns the same log, limited to messages from `start_s` to before `end_s`, s."""
        return Log(self.path, self._source, clipped(self._range_ns, start_s, end_s))

    # ----------------------------------------------------------------------------------- messages

    def messages(self, *topics: str) -> Iterator[LoggedMessage]:
        """Yields the messages of topics, or of all, one by one in the order of the log.

        topics: names or patterns such as `/uav*/odom`, `/uav1/**`. Messages that cannot be decoded
        are left out. Raises `VoleryError` if a pattern is invalid or matches no topic.
        """
        decoder = LogDecoder()
        for record in self._source.records(set(self._matching(topics)), *self._range_ns):
            try:
                message = decoder.decode(record).message
            except GraphError:
                continue
            yield LoggedMessage(record.topic.topic, record.time_ns, message)

    def to_pandas(self, topics: str, fields: Iterable[str] = ()) -> pandas.DataFrame:
        """Returns a topic, or topics of several UAVs in one table, with the index `time_s`.

        topics: a name, or a pattern such as `/*/odom`, whose topics have one type; the table then
        has the first part of each name in the column `uav` and is sorted by time. fields: names,
        as in `TopicData.to_pandas`; empty: all. Needs pandas.
        """
        fields = tuple(fields)
        if topics in self:
            return self[topics].to_pandas(fields)
        names = self._matching((topics,))
        types = {self.topics[name].msgtype for name in names}
        if len(types) > 1:
            raise VoleryError(
                f"the topics of '{topics}' have several types ({', '.join(sorted(types))}): use a "
                "pattern for one of them"
            )
        load_numbers([self[name] for name in names])
        frames = []
        for name in names:
            frame = self[name].to_pandas(fields)
            frame.insert(0, "uav", self[name].uav)
            frames.append(frame)
        import pandas

        return pandas.concat(frames).sort_index(kind="stable")

    @property
    def tf(self) -> LoggedTransforms:
        """Transforms of `/tf` and `/tf_static`; read anew at each use."""
        here = [name for name in ("/tf_static", "tf_static", "/tf", "tf") if name in self]
        found = self.messages(*here) if here else iter(())
        return LoggedTransforms(found)

    def trajectory(self, uav: str, topic: str | None = None) -> LoggedTrajectory:
        """Returns the poses of a UAV, from the ground truth if it is recorded, else an estimate.

        topic: the topic with the poses; None: the preferred one of that UAV. Raises `VoleryError`
        if there are none.
        """
        if topic is None:
            return self.trajectories(uav)[uav]
        return read_trajectory(uav, self[topic])

    def trajectories(self, *uavs: str) -> dict[str, LoggedTrajectory]:
        """Returns the poses of UAVs, or of all, by name; reads the log once.

        Raises `VoleryError` for a UAV without poses.
        """
        known = pose_topics(self.topics)
        for uav in uavs:
            if uav not in known:
                names = ", ".join(known) or "none"
                raise VoleryError(f"{self.path}: there are no poses of '{uav}'; UAVs: {names}")
        found = {uav: self[known[uav]] for uav in uavs or known}
        load_numbers(list(found.values()))
        return {uav: read_trajectory(uav, data) for uav, data in found.items()}

    # ------------------------------------------------------------------------------------ figures

    def plot(self, topic: str, *fields: str, axes: Axes | None = None) -> Axes:
        """Draws fields of a topic over time; returns matplotlib's axes."""
        return self[topic].plot(*fields, axes=axes)

    def plot_paths(self, *uavs: str, axes: Axes | None = None) -> Axes:
        """Draws the paths of UAVs, or of all, from above; returns matplotlib's axes."""
        from volery.logs.drawing import draw_paths

        paths = self._paths(uavs)
        if not paths:
            raise VoleryError(f"{self.path}: there are no topics with poses to draw")
        return draw_paths(paths, axes)

    # ------------------------------------------------------------------------------------- closing

    def close(self) -> None:
        """Closes the file; data that were read remain."""
        self._source.close()

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return (
            f"Log({str(self.path)!r}: {counted(len(self), 'topic')}, {self.duration_s:.3f} s"
            f"{', ' + self.problem if self.problem else ''})"
        )

    def _repr_html_(self) -> str:
        """Returns the topics as a table, and a map with the paths, for notebooks."""
        from volery.logs.drawing import paths_html

        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(count.msgtype)}</td>"
            f"<td>{count.messages:,}</td></tr>"
            for name, count in self.topics.items()
        )
        problem = f"<div>{escape(self.problem)}</div>" if self.problem else ""
        return (
            f"<div><b>{escape(self.path.name)}</b>: {self.start_s:.3f} to {self.end_s:.3f} s, "
            f"{counted(len(self), 'topic')}</div>{problem}<table><tr><th>topic</th><th>type</th>"
            f"<th>messages</th></tr>{rows}</table>{paths_html(self._paths())}"
        )

    # -------------------------------------------------------------------------------------- inside

    def _paths(self, uavs: tuple[str, ...] = ()) -> dict[str, Array]:
        """Returns the positions (n, 3), m, of UAVs, or of all, by label."""
        return {
            uav if uav == found.topic else f"{uav} ({found.topic})": found.position
            for uav, found in self.trajectories(*uavs).items()
        }

    def _matching(self, patterns: tuple[str, ...]) -> list[str]:
        """Returns the topics that match names or patterns; all without any."""
        if not patterns:
            return list(self.topics)
        exact = {pattern for pattern in patterns if pattern in self}
        matches = topic_filter([pattern for pattern in patterns if pattern not in exact])
        found = [name for name in self.topics if name in exact or matches(name)]
        for pattern in patterns:
            if pattern not in exact and not any(map(topic_filter([pattern]), self.topics)):
                raise VoleryError(self._unknown(pattern))
        return found

    def _unknown(self, topic: str) -> str:
        from difflib import get_close_matches

        near = get_close_matches(topic, list(self.topics), _CLOSEST, 0.4)
        hint = f"similar ones: {', '.join(near)}" if near else "see Log.topics"
        return f"{self.path}: there is no topic '{topic}'; {hint}"
