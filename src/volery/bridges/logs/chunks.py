"""Random access to a log: the positions, times and contents of its chunks.

The index is built by skipping through the file from record to record, so that a truncated log works
as well as a whole one. Compressed data is read only if no index describes its contents.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections import Counter, OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.budgets import (
    KEPT_BYTES,
    MAX_CHUNK_BYTES,
    MAX_CHUNKS,
    MAX_RECORDS,
    TopicBudget,
    UnpackingBudget,
)
from volery.bridges.logs.content import Content, DamageCount, Head
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import RecordingError

_CHUNKS_KEPT = 8
"""Largest number of decompressed chunks in the cache; fewer if they are large."""


class Span(NamedTuple):
    """A part of the file that is read at once: position and length."""

    position: int
    length: int


@dataclass(frozen=True)
class Chunk:
    """Messages that are stored together: their times, and the number of messages by channel."""

    span: Span
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]
    falls_ns: int
    """Largest time by which a message is earlier than one before it in the chunk."""

    @classmethod
    def of_times(cls, span: Span, counts: Mapping[int, int], times_ns: NDArray[np.int64]) -> Chunk:
        """Returns a chunk with messages at `times_ns` (N,), N > 0, in their order."""
        falls = np.maximum.accumulate(times_ns) - times_ns
        first, last = int(times_ns.min()), int(times_ns.max())
        return cls(span, first, last, counts, int(falls.max()))


class Unindexed(NamedTuple):
    """A chunk whose contents the file's index does not describe."""

    span: Span


class ChunkedLog(ABC):
    """Reads the chunks of one file; a damaged chunk is empty, and `problem` describes the damage.

    Raises `RecordingError` if the file describes or unpacks to more than the limits.
    """

    format = ""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, LogTopic] = {}
        """Topics by channel."""
        self._cut = ""
        """What is missing at the file's end."""
        self._damage = DamageCount()
        self._file = path.open("rb", buffering=0)
        self.size = os.fstat(self._file.fileno()).st_size
        self._kept: OrderedDict[Span, Content] = OrderedDict()
        self._found: list[Chunk | Unindexed] = []
        self._unpacking: UnpackingBudget | None = UnpackingBudget(path, self.size)
        self._described = TopicBudget(path)
        self._records = 0
        try:
            self._scan()
            self.chunks = [
                chunk for found in self._found if (chunk := self._with_counts(found)).counts
            ]
            self._learn_channels()
        except BaseException:
            self.close()
            raise
        self._unpacking = (
            None  # from here on playback determines what is unpacked, a chunk at a time
        )

    @property
    def problem(self) -> str:
        """Problems of the file, as far as it was read; empty for a whole one."""
        return "; ".join(part for part in (self._cut, self._damage.describe()) if part)

    @property
    def damaged(self) -> int:
        """Number of chunks and records skipped so far."""
        return self._damage.count

    def counts(self) -> Counter[int]:
        """Returns the number of messages of each channel."""
        total: Counter[int] = Counter()
        for chunk in self.chunks:
            total.update(chunk.counts)
        return total

    def content(self, chunk: Chunk) -> Content:
        """Returns the content of a chunk."""
        return self._content(chunk.span)

    def record(self, content: Content, head: Head) -> LogRecord:
        """Returns one message of a chunk's content."""
        data = content.data[head.begin : head.end]
        return LogRecord(self.topics[head.channel], head.time_ns, data, head.sequence)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()
        self._kept.clear()

    # ------------------------------------------------------------------------------------ inside

    @abstractmethod
    def _scan(self) -> None:
        """Stores all chunks in `_found`, in the order of the file.

        Reads the records outside of chunks.
        """

    @abstractmethod
    def _parse(self, data: bytes) -> Content:
        """Returns the messages of a span and reads its channels. Raises `ValueError` if damaged."""

    def _read(self, position: int, length: int) -> bytes:
        return os.pread(self._file.fileno(), length, position)

    def _count_record(self) -> None:
        """Counts a record outside of chunks. Raises `RecordingError` if there are too many."""
        self._records += 1
        if self._records > MAX_RECORDS or len(self._found) > MAX_CHUNKS:
            raise RecordingError(
                f"{self.path}: has more than {MAX_CHUNKS} chunks or {MAX_RECORDS} records; it is "
                "not read any further"
            )

    def _content(self, span: Span) -> Content:
        kept = self._kept.get(span)
        if kept is None:
            try:
                kept = self._parsed(span)
            except ValueError as error:
                kept = Content()
                self._damage.add(span.position, error)
            self._kept[span] = kept
            while len(self._kept) > 1 and self._keeps_too_much():
                self._kept.popitem(last=False)
        else:
            self._kept.move_to_end(span)
        return kept

    def _parsed(self, span: Span) -> Content:
        if span.length > MAX_CHUNK_BYTES:
            raise ValueError(f"a chunk of {span.length} bytes; at most {MAX_CHUNK_BYTES} are read")
        content = self._parse(self._read(*span))
        if self._unpacking is not None:
            self._unpacking.spend(len(content.data))
        return content

    def _keeps_too_much(self) -> bool:
        kept = sum(content.memory_bytes for content in self._kept.values())
        return len(self._kept) > _CHUNKS_KEPT or kept > KEPT_BYTES

    def _with_counts(self, found: Chunk | Unindexed) -> Chunk:
        """Returns the chunk with its times and counts, which are read if the index lacks them."""
        if isinstance(found, Chunk):
            return found
        heads = self._content(found.span).heads
        if not heads:
            return Chunk(found.span, 0, 0, {}, 0)
        counts = Counter(head.channel for head in heads)
        self._records += len(counts)
        times = np.array([head.time_ns for head in heads], np.int64)
        return Chunk.of_times(found.span, counts, times)

    def _learn_channels(self) -> None:
        """Reads the chunks with channels that no record outside of them describes."""
        for chunk in self.chunks:
            if not chunk.counts.keys() <= self.topics.keys():
                self._content(chunk.span)
        known = self.topics.keys()
        whole = (
            replace(c, counts={k: n for k, n in c.counts.items() if k in known})
            for c in self.chunks
        )
        self.chunks = [chunk for chunk in whole if chunk.counts]
