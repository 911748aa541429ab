"""Reads the samples of selected topics from a log of PX4 (ULog), whole, truncated or damaged."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Set
from pathlib import Path
from typing import BinaryIO, NamedTuple

from volery.bridges.logs.budgets import MAX_TIME_NS, TopicBudget
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import RecordingError
from volery.logs.topic_count import TopicCount
from volery.logs.ulog_format import TEXTS, US_NS, UlogTopic, text_cdr
from volery.logs.ulog_recovery import HEAD, KINDS, UlogRecovery, after_unknown_kinds

MAGIC = b"ULog\x01\x12\x35"
_HEADER_BYTES = 16
_NUMBER = struct.Struct("<H")
_SUBSCRIPTION = struct.Struct("<BH")
_TEXT = struct.Struct("<BQ")
_TAGGED_TEXT = struct.Struct("<BHQ")
_FLAGS = struct.Struct("<8s8s3Q")


class _Message(NamedTuple):
    kind: int
    payload: bytes


class _Sample(NamedTuple):
    topic: LogTopic
    time_ns: int
    layout: UlogTopic | None
    """Layout of the data; None for texts."""
    data: bytes


class UlogSource:
    """Reads a .ulg file; see `LogSource`. Times are those since the vehicle's start.

    Raises `RecordingError` if the file cannot be read, or is no ULog.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problem = ""
        self._problems: dict[str, None] = {}
        self.start_ns, self.end_ns = MAX_TIME_NS, 0
        counts: Counter[LogTopic] = Counter()
        for sample in self._samples():
            counts[sample.topic] += 1
            self.start_ns = min(self.start_ns, sample.time_ns)
            self.end_ns = max(self.end_ns, sample.time_ns)
        self.start_ns = min(self.start_ns, self.end_ns)
        self.topics = {
            topic.topic: TopicCount(topic.msgtype, count)
            for topic, count in sorted(counts.items(), key=lambda pair: pair[0].topic)
        }
        self.problem = "; ".join(self._problems)

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""
        for topic, time_ns, layout, data in self._samples():
            if topic.topic in topics and start_ns <= time_ns < end_ns:
                packed = text_cdr(data[0], data[1:]) if layout is None else layout.cdr(data)
                yield LogRecord(topic, time_ns, packed, 0)

    def close(self) -> None:
        """Does nothing: the file is opened for each reading."""

    # ------------------------------------------------------------------------------------ inside

    def _samples(self) -> Iterator[_Sample]:
        formats: dict[str, str] = {}
        layouts: dict[int, UlogTopic] = {}
        budget = TopicBudget(self._path)
        for kind, payload in self._messages():
            sample: _Sample | None = None
            if kind == ord("D") and len(payload) > _NUMBER.size:
                layout = layouts.get(_NUMBER.unpack_from(payload)[0])
                sample = None if layout is None else _sample(layout, payload[_NUMBER.size :])
            elif kind in b"LC":
                sample = _text_sample(_TEXT if kind == ord("L") else _TAGGED_TEXT, payload)
            elif kind == ord("F"):
                budget.spend(len(payload))
                name, _, fields = payload.decode("ascii", "replace").partition(":")
                formats[name] = fields
            elif kind == ord("A") and len(payload) > _SUBSCRIPTION.size:
                budget.spend(len(payload))
                instance, number = _SUBSCRIPTION.unpack_from(payload)
                name = payload[_SUBSCRIPTION.size :].decode("ascii", "replace")
                try:
                    layouts[number] = UlogTopic(name, instance, formats)
                except ValueError as error:
                    self._problems[str(error)] = None
            if sample is None:
                continue
            if sample.time_ns <= MAX_TIME_NS:
                yield sample
            else:
                name = sample.topic.topic
                self._problems[f"{name} has times later than ROS can represent; left out"] = None

    def _messages(self) -> Iterator[_Message]:
        """Yields all messages; notes where the file is cut off or damaged."""
        try:
            size = self._path.stat().st_size
            file = self._path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot read the log: {error.strerror}") from None
        with file:
            if not file.read(_HEADER_BYTES).startswith(MAGIC):
                raise RecordingError(f"{self._path}: is no ULog of PX4")
            recovery = UlogRecovery()
            yield from self._walk(file, size, recovery)
            if recovery.problem:
                self._problems[recovery.problem] = None

    def _walk(self, file: BinaryIO, size: int, recovery: UlogRecovery) -> Iterator[_Message]:
        """Yields all messages after the header of a file; skips damaged bytes."""
        position, ends = _HEADER_BYTES, [size]
        while position < size:
            if len(ends) > 1 and position == ends[0]:
                del ends[0]
            file.seek(position)
            head = file.read(HEAD.size)
            length, kind = HEAD.unpack(head) if len(head) == HEAD.size else (0, ord("S"))
            begin, position = position, position + HEAD.size + length
            if position > ends[0]:
                if recovery.has_sync(file, begin + 1, ends[0]):
                    position = recovery.resume(file, begin, ends[0])
                elif len(ends) == 1:
                    self._problems[f"cut off in the middle of a message at byte {begin}"] = None
                    return
                else:
                    position = ends.pop(0)  # a message is cut off where data were appended
                continue
            if kind not in KINDS:
                after = after_unknown_kinds(file, begin, ends[0])
                position = recovery.resume(file, begin, ends[0]) if after is None else after
                continue
            payload = file.read(length)
            if kind == ord("B") and length >= _FLAGS.size:
                _, needed, *appended = _FLAGS.unpack_from(payload)
                if needed[0] & ~1 or any(needed[1:]):
                    raise RecordingError(
                        f"{self._path}: needs features of ULog that are not known here"
                    )
                ends = [*sorted(a for a in appended if position < a < size), size]
            yield _Message(kind, payload)


def _sample(layout: UlogTopic, data: bytes) -> _Sample | None:
    """Returns a sample of a topic; None if it is too short."""
    time_ns = layout.time_ns(data)
    return None if time_ns is None else _Sample(layout.topic, time_ns, layout, data)


def _text_sample(form: struct.Struct, payload: bytes) -> _Sample | None:
    """Returns a logged text; None if it is too short."""
    if len(payload) < form.size:
        return None
    severity, *_, time_us = form.unpack_from(payload)
    text = bytes((severity & 7,)) + payload[form.size :]  # an ASCII digit: 0x30 to 0x37
    return _Sample(TEXTS, time_us * US_NS, None, text)
