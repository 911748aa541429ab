"""Limits the cost of reading a log: what a file announces and what it unpacks to.

Logs may be untrusted. A few bytes can unpack to gigabytes, and a few megabytes of records can
describe millions of topics. Every reader stops at these limits; real logs stay far below.
"""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import RecordingError

MAX_CHUNK_BYTES = 256 << 20
"""Largest chunk, packed or unpacked, or message outside of chunks. Recorders write 1 to 100 MB."""
MAX_CHUNK_MESSAGES = 1_000_000
MAX_CHUNKS = 500_000
"""Largest number of chunks of one file."""
MAX_RECORDS = 5_000_000
"""Largest number of records of one file outside of its chunks: chunks, and their indexes by topic.
"""
MAX_HEAD_BYTES = 1 << 20
"""Largest head of a bag's record."""
MAX_TIME_NS = (1 << 31) * 1_000_000_000 - 1
"""Latest time of a message: seconds of ROS 2 are signed and have 32 bits, to 2038."""
MAX_TOPICS = 20_000
"""Largest number of topics of one file, and of schemas."""
MAX_DEFINITION_BYTES = 1 << 20
"""Largest message definition with all nested types."""
MAX_DEFINITIONS_BYTES = 64 << 20
"""Largest sum of all definitions of one file."""
MAX_NESTED_TYPES = 512
"""Largest number of types that one message definition nests."""
MAX_INDEX_BYTES = 64 << 20
"""Largest index at a file's end: topics, and the positions of the chunks."""
KEPT_BYTES = 256 << 20
"""Unpacked chunks that a player caches; at least one, however large."""

_FREE_BYTES = 1 << 30
_MAX_RATIO = 256
"""lz4 packs at most 255 to 1, so that every valid lz4 log passes."""


class UnpackingBudget:
    """Counts the bytes that a file unpacks to in one pass: at most 1 GiB and 256 times its size."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._max_bytes = _FREE_BYTES + _MAX_RATIO * size
        self._spent = 0

    def spend(self, count: int) -> None:
        """Counts unpacked bytes. Raises `RecordingError` if there are too many."""
        self._spent += count
        if self._spent > self._max_bytes:
            raise RecordingError(
                f"{self._path}: unpacks to more than {self._max_bytes / 1e9:.1f} GB, more than any "
                "log of its size does; the rest is not read"
            )


class TopicBudget:
    """Counts the topics and definitions of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0
        self._bytes = 0

    def spend(self, definition_bytes: int) -> None:
        """Counts a topic or a schema. Raises `RecordingError` if there are too many."""
        self._count += 1
        self._bytes += definition_bytes
        if self._count > 2 * MAX_TOPICS or self._bytes > MAX_DEFINITIONS_BYTES:
            raise RecordingError(
                f"{self._path}: describes more than {MAX_TOPICS} topics, or has more than "
                f"{MAX_DEFINITIONS_BYTES >> 20} MiB of message definitions; it is not read any "
                "further"
            )
