"""How much a log may cost its reader: bounds on what a file says and on what it unpacks to.

A log is often a stranger's. Some bytes of it can unpack to gigabytes, and a few megabytes of
records can describe millions of topics. Every reader stops at these bounds; real logs stay far
below.
"""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import RecordingError

MAX_CHUNK_BYTES = 256 << 20
"""Of one chunk, packed or unpacked, or a message outside of chunks. Recorders write 1 to 100 MB."""
MAX_CHUNK_MESSAGES = 1_000_000
MAX_CHUNKS = 500_000
"""Of one file."""
MAX_RECORDS = 5_000_000
"""Of one file, outside of its chunks: chunks, and their indexes by topic."""
MAX_HEAD_BYTES = 1 << 20
"""Of the fields in front of a bag's record."""
MAX_TIME_NS = (1 << 31) * 1_000_000_000 - 1
"""Seconds of ROS 2 are 32 bits with a sign: to 2038."""
MAX_TOPICS = 20_000
"""Of one file, and as many schemas."""
MAX_DEFINITION_BYTES = 1 << 20
"""Of one message definition with all that it nests."""
MAX_DEFINITIONS_BYTES = 64 << 20
"""Of all definitions of one file together."""
MAX_NESTED_TYPES = 512
"""Of one message definition."""
MAX_INDEX_BYTES = 64 << 20
"""Of the index at a file's end: topics, and where the chunks are."""
KEPT_BYTES = 256 << 20
"""Of unpacked chunks that a player keeps in memory; of at least one, however large."""

_FREE_BYTES = 1 << 30
_MAX_RATIO = 256
"""lz4 packs at most 255 to 1, so that every honest lz4 log passes, whatever is in it."""


class UnpackingBudget:
    """Counts the bytes that a file unpacks to in one pass: at most 1 GiB and 256 times its size."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._most = _FREE_BYTES + _MAX_RATIO * size
        self._spent = 0

    def spend(self, count: int) -> None:
        """Count so many bytes. `RecordingError` where there are more than in any log."""
        self._spent += count
        if self._spent > self._most:
            raise RecordingError(
                f"{self._path}: unpacks to more than {self._most / 1e9:.1f} GB, more than any log "
                "of its size does; it is not read any further"
            )


class TopicBudget:
    """Counts the topics and definitions that one file describes."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0
        self._bytes = 0

    def spend(self, definition_bytes: int) -> None:
        """Count a topic or a schema. `RecordingError` where there are more than any log has."""
        self._count += 1
        self._bytes += definition_bytes
        if self._count > 2 * MAX_TOPICS or self._bytes > MAX_DEFINITIONS_BYTES:
            raise RecordingError(
                f"{self._path}: describes more than {MAX_TOPICS} topics, or has more than "
                f"{MAX_DEFINITIONS_BYTES >> 20} MiB of message definitions; it is not read any "
                "further"
            )
