"""What a chunk of a log holds, and the count of those that are damaged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Head(NamedTuple):
    """A message in a chunk's bytes."""

    channel: int
    time_ns: int
    begin: int
    end: int
    sequence: int


@dataclass(frozen=True)
class Content:
    """What a chunk holds, in the order of the log."""

    heads: tuple[Head, ...] = ()
    data: bytes = b""

    @property
    def memory_bytes(self) -> int:
        """About what it takes to keep it."""
        return len(self.data) + _HEAD_BYTES * len(self.heads)


_HEAD_BYTES = 250
"""Of a `Head` and its numbers."""


@dataclass
class DamageCount:
    """Counts damaged chunks and records, and remembers the first."""

    count: int = 0
    first: str = ""

    def add(self, position: int, error: Exception) -> None:
        """Count one that begins at a byte of the file."""
        self.count += 1
        self.first = self.first or f"at byte {position}: {error}"

    def describe(self) -> str:
        """Returns a phrase for people; empty where nothing is damaged."""
        if not self.count:
            return ""
        if self.count == 1:
            return f"1 damaged chunk left out, {self.first}"
        return f"{self.count} damaged chunks left out, the first {self.first}"
