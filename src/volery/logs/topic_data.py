"""The messages of one topic as columns: times, and an array for each field."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.decoding import LogDecoder
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import GraphError, RecordingError, VoleryError
from volery.core.plurals import counted
from volery.graph.codecs.cdr import known
from volery.graph.codecs.ros1_names import ros2_name
from volery.logs.columns import Columns, Wanted, read_columns
from volery.logs.fields import Column, fields_of, is_time, nanoseconds, parts_of
from volery.logs.message_arrays import cloud_array, image_array, scan_angles
from volery.logs.sources import LogSource

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
WHOLE_NS = (0, 1 << 62)
"""Range of all times, ns."""
_CLOUD, _SCAN = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan"


class LoggedMessage(NamedTuple):
    """A message of a log."""

    topic: str
    """Name of the topic."""
    time_ns: int
    """Time of the log, ns: when the message was recorded."""
    message: Any
    """Message with the fields of its type; arrays are read-only."""


class TopicData:
    """The n messages of one topic, in the order of the log.

    `data["pose.pose.position.z"]` is a field of all messages, `data["pose.pose.position"]` the
    fields of a message of numbers as one array (n, 3). Numbers are read together at the first use
    and then kept; texts, arrays and lists are read at each use.
    """

    def __init__(
        self, source: LogSource, topic: str, msgtype: str, start_ns: int, end_ns: int
    ) -> None:
        self._source, self._range_ns = source, (start_ns, end_ns)
        self.topic = topic
        """Name of the topic."""
        self.msgtype = msgtype
        """Name of the type in ROS 2 style."""
        self._kept: Columns | None = None

    def __repr__(self) -> str:
        return f"TopicData({self.topic!r}, {self.msgtype})"

    @property
    def uav(self) -> str:
        """First part of the topic's name, which is the UAV's; empty for `/tf`."""
        first, slash, _ = self.topic[1:].partition("/")
        return first if slash else ""

    def __len__(self) -> int:
        """Returns the number of messages, n."""
        return len(self.times_ns)

    @property
    def refused(self) -> int:
        """Number of messages that are left out: they cannot be decoded, or have another type."""
        return self._numbers.refused

    # ----------------------------------------------------------------------------------- columns

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of all fields, with dots."""
        return tuple(field.name for field in fields_of(self._type))

    @property
    def times_ns(self) -> NDArray[np.int64]:
        """Times (n,) of the log, ns: when the messages were recorded."""
        return self._numbers.times_ns

    @property
    def times_s(self) -> Array:
        """Times (n,) of the log, s."""
        return self.times_ns / NS_PER_S

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Stamps (n,) of the headers, ns. Raises `VoleryError` for a type without header."""
        return self["header.stamp"]

    def __contains__(self, field: object) -> bool:
        """Returns whether the type has a field or a message of numbers of this name."""
        try:
            return isinstance(field, str) and bool(parts_of(field, self._type))
        except VoleryError:
            return False

    def __getitem__(self, field: str) -> Column:
        """Returns a field of all messages.

        Numbers (n,); arrays of equal lengths (n, length); other arrays, texts and lists (n,) of
        objects. A message of k numbers (n, K); a stamp (n,), ns. Raises `VoleryError`, with
        similar names, for an unknown one.
        """
        if not isinstance(field, str):
            raise VoleryError(
                f"{self.topic}: a field is a name such as '{self.fields[0]}', not {field!r}; "
                "messages() yields messages"
            )
        return self.columns(field)[field]

    def columns(self, *fields: str) -> dict[str, Column]:
        """Returns several fields, or all, by name; as `data[field]`, but reads the log once."""
        names = fields or self.fields
        parts = {name: parts_of(name, self._type) for name in names}
        found = self._numbers.columns
        missing = {part for some in parts.values() for part in some} - found.keys()
        if missing:
            found = found | self._read(missing)
        return {name: self._joined(name, [found[part] for part in parts[name]]) for name in names}

    def padded(self, field: str, fill: float = np.nan) -> Column:
        """Returns arrays of numbers of different lengths as one array (n, K), padded with `fill`.

        Raises `VoleryError` for a field of texts or messages.
        """
        values = self[field]
        if values.ndim == 2:
            return values
        if any(not isinstance(value, np.ndarray) for value in values):
            raise VoleryError(f"'{field}' of {self.topic} holds no arrays of numbers to pad")
        longest = max((len(value) for value in values), default=0)
        dtype = np.result_type(*{value.dtype for value in values}) if len(values) else np.float64
        if np.isnan(fill):
            dtype = np.result_type(dtype, np.float32)
        rows = np.full((len(values), longest), fill, dtype)
        for row, value in zip(rows, values, strict=True):
            row[: len(value)] = value
        return rows

    def between(self, start_s: float = 0.0, end_s: float = np.inf) -> TopicData:
        """Returns the messages from `start_s` to before `end_s`, s, of the log's time."""
        start_ns, end_ns = clipped(self._range_ns, start_s, end_s)
        return TopicData(self._source, self.topic, self.msgtype, start_ns, end_ns)

    def to_pandas(self, fields: Iterable[str] = ()) -> pandas.DataFrame:
        """Returns fields, or all, as a table with the index `time_s`; needs pandas.

        A column for each number and text; arrays and lists are objects. A message of numbers in
        `fields`, such as `pose.pose.position`, becomes a column for each of its fields.
        """
        from volery.core.data_frames import data_frame

        parts = [part for name in fields for part in parts_of(name, self._type)]
        found = self.columns(*parts)
        columns = {name: list(c) if c.ndim > 1 else c for name, c in found.items()}
        frame = data_frame({"time_s": self.times_s, **columns})
        return frame.set_index("time_s")

    # ---------------------------------------------------------------------------------- messages

    def __iter__(self) -> Iterator[LoggedMessage]:
        """Yields the messages, as `messages`."""
        return self.messages()

    def messages(self) -> Iterator[LoggedMessage]:
        """Yields the messages one by one, without keeping them."""
        decoder = LogDecoder()
        for record in self._source.records({self.topic}, *self._range_ns):
            try:
                decoded = decoder.decode(record)
            except GraphError:
                continue
            if decoded.msgtype == self._type:
                yield LoggedMessage(self.topic, record.time_ns, decoded.message)

    def images(self) -> Iterator[NDArray[Any]]:
        """Yields images (H, W) or (H, W, C) one by one.

        Colours are red, green, blue; depth is in m (floats) or mm (uint16), as recorded. Raises
        `VoleryError` for a topic without images or an unknown encoding.
        """
        self._check_type(_IMAGES, "images")
        for found in self.messages():
            yield image_array(found.message)

    def clouds(self) -> Iterator[NDArray[Any]]:
        """Yields the points (N,) of PointCloud2s one by one, as structured arrays (`["x"]`)."""
        self._check_type((_CLOUD,), "point clouds")
        for found in self.messages():
            yield cloud_array(found.message)

    @property
    def angles_rad(self) -> Array:
        """Angles (K,), rad, of the beams of LaserScans, by the first scan."""
        self._check_type((_SCAN,), "scans")
        for found in self.messages():
            return scan_angles(found.message)
        return np.zeros(0)

    # ----------------------------------------------------------------------------------- figures

    def plot(self, *fields: str, axes: Axes | None = None) -> Axes:
        """Draws fields of numbers over time; returns matplotlib's axes.

        axes: where to draw; None: a new figure of pyplot.
        """
        from volery.logs.drawing import draw_fields

        if not fields:
            raise VoleryError(f"name the fields of {self.topic} to plot: {', '.join(self.fields)}")
        lines = [part for name in fields for part in self._lines_of(name)]
        return draw_fields(self.topic, self.times_s, self.columns(*lines), axes)

    # ------------------------------------------------------------------------------------ inside

    @cached_property
    def _type(self) -> str:
        """Name of the type, which is learned from the log if it is unknown."""
        try:
            for record in self._source.records({self.topic}, *WHOLE_NS):
                return LogDecoder().type_of(record.topic)
            name = ros2_name(self.msgtype)
            known(name)
        except GraphError as error:
            raise RecordingError(f"{self.topic} cannot be read: {error}") from None
        return name

    @property
    def _numbers(self) -> Columns:
        """Times and all numbers, which are kept."""
        if self._kept is None:
            load_numbers([self])
        assert self._kept is not None
        return self._kept

    def _wanted_numbers(self) -> Wanted:
        names = [field.name for field in fields_of(self._type) if field.dtype is not None]
        return Wanted(self._type, names)

    def _read(self, names: Iterable[str]) -> dict[str, Column]:
        """Reads columns in one pass over the log."""
        wanted = {self.topic: Wanted(self._type, names)}
        return read_columns(self._source, wanted, *self._range_ns)[self.topic].columns

    def _joined(self, name: str, columns: list[Column]) -> Column:
        if is_time(name, self._type):
            return nanoseconds(*columns)
        return columns[0] if len(columns) == 1 else np.stack(columns, axis=1)

    def _lines_of(self, field: str) -> tuple[str, ...]:
        """Returns the fields of a message, which are drawn as lines with their names."""
        return (field,) if is_time(field, self._type) else parts_of(field, self._type)

    def _check_type(self, types: tuple[str, ...], what: str) -> None:
        if self._type not in types:
            raise VoleryError(f"{self.topic} holds no {what}: its type is {self._type}")


def load_numbers(topics: Sequence[TopicData]) -> None:
    """Reads the numbers of topics of one log and range of times, in one pass over the log.

    Raises `RecordingError` if a topic has messages of which none can be decoded.
    """
    missing = {data.topic: data for data in topics if data._kept is None}
    if not missing:
        return
    first = next(iter(missing.values()))
    wanted = {name: data._wanted_numbers() for name, data in missing.items()}
    found = read_columns(first._source, wanted, *first._range_ns)
    for name, data in missing.items():
        columns = found[name]
        if columns.refused and not len(columns.times_ns):
            raise RecordingError(
                f"{name} cannot be read: none of its {counted(columns.refused, 'message')} can be "
                f"decoded; the first: {columns.problem}"
            )
        data._kept = columns


def clipped(range_ns: tuple[int, int], start_s: float, end_s: float) -> tuple[int, int]:
    """Returns the common part of a range of times, ns, and of `start_s` to `end_s`.

    Raises `VoleryError` if a time is not a number.
    """
    if np.isnan(start_s) or np.isnan(end_s):
        raise VoleryError(f"a range of times needs two numbers (found {start_s} and {end_s})")
    start_ns, end_ns = range_ns
    if start_s * NS_PER_S > start_ns:
        start_ns = ns_from_s(start_s) if np.isfinite(start_s) else end_ns
    if end_s * NS_PER_S < end_ns:
        end_ns = ns_from_s(end_s) if np.isfinite(end_s) else start_ns
    return start_ns, max(start_ns, end_ns)
