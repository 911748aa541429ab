"""Reads fields of topics' messages as columns, several topics in one pass over the log."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.records import LogRecord
from volery.core.errors import GraphError
from volery.logs.fields import Column, Field, fields_of
from volery.logs.sources import LogSource


class Wanted(NamedTuple):
    """What is read of a topic: its type, and names of fields with dots."""

    msgtype: str
    """Name of the type in ROS 2 style."""
    fields: Iterable[str]
    """Names of fields with dots."""


class Columns(NamedTuple):
    """Times and columns of the n messages of a topic that can be decoded."""

    times_ns: NDArray[np.int64]
    """(n,) time of the log, ns."""
    columns: dict[str, Column]
    """Columns by names of fields."""
    refused: int
    """Number of messages that cannot be decoded, or have another type."""
    problem: str
    """Why the first of them cannot be decoded."""


def read_columns(
    source: LogSource, wanted: Mapping[str, Wanted], start_ns: int, end_ns: int
) -> dict[str, Columns]:
    """Reads fields of topics in one pass over the log, from `start_ns` to before `end_ns`."""
    decoder = LogDecoder()
    collectors = {topic: _Collector(*what) for topic, what in wanted.items()}
    for record in source.records(wanted.keys(), start_ns, end_ns):
        collector = collectors[record.topic.topic]
        try:
            collector.add(record, *decoder.decode(record))
        except GraphError as error:
            collector.refuse(str(error))
    return {topic: collector.columns() for topic, collector in collectors.items()}


class _Collector:
    """Collects fields of one topic's messages; numbers take only their own bytes."""

    def __init__(self, msgtype: str, names: Iterable[str]) -> None:
        self._msgtype = msgtype
        known = {field.name: field for field in fields_of(msgtype)}
        self._fields = [known[name] for name in names]
        self._values: list[Any] = [_empty(field) for field in self._fields]
        self._reads = [
            (attrgetter(field.name), values.append)
            for field, values in zip(self._fields, self._values, strict=True)
        ]
        self._times = array("q")
        self._is_ros1 = False
        self._refused = 0
        self._problem = ""

    def add(self, record: LogRecord, msgtype: str, message: Any) -> None:
        """Adds a message; counts it if its type is another."""
        if msgtype != self._msgtype:
            self.refuse(f"its type is {msgtype}")
            return
        self._times.append(record.time_ns)
        self._is_ros1 = record.topic.encoding == "ros1"
        for read, append in self._reads:
            append(read(message))

    def refuse(self, problem: str) -> None:
        """Counts a message that is left out."""
        self._refused += 1
        self._problem = self._problem or problem

    def columns(self) -> Columns:
        """Returns what was collected."""
        pairs = zip(self._fields, self._values, strict=True)
        found = {field.name: _column(field, values, self._is_ros1) for field, values in pairs}
        return Columns(np.array(self._times, np.int64), found, self._refused, self._problem)


def _empty(field: Field) -> Any:
    return [] if field.dtype is None else array(np.dtype(field.dtype).char.replace("?", "B"))


def _column(field: Field, values: Any, is_ros1: bool) -> Column:
    """Returns the values of a field in n messages as one array.

    Numbers: (n,). Arrays of equal lengths: (n, length). All else: (n,) of objects.
    """
    is_octet = field.is_byte and not is_ros1
    if field.dtype is not None:
        numbers = np.array(values).astype(field.dtype, copy=False)
        return numbers.view(np.uint8) if is_octet else numbers
    if is_octet:
        values = [value.view(np.uint8) for value in values]
    if field.is_array and len({len(value) for value in values}) == 1:
        return np.stack(values)
    if field.length is not None:
        return np.zeros((0, field.length))
    found = np.empty(len(values), dtype=object)
    for k, value in enumerate(values):
        found[k] = value
    return found
