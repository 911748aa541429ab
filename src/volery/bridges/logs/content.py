"""The content of a log's chunk, and the count of damaged chunks."""

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
    """Messages of a chunk, in the order of the log."""

    heads: tuple[Head, ...] = ()
    data: bytes = b""

    @property
    def memory_bytes(self) -> int:
        """Approximate memory of the content."""
        return len(self.data) + _HEAD_BYTES * len(self.heads)


_HEAD_BYTES = 250
"""Memory of a `Head` and its numbers."""


@dataclass
class DamageCount:
    """Counts damaged chunks and records; stores the first problem."""

    count: int = 0
    first: str = ""

    def add(self, position: int, error: Exception) -> None:
        """Counts a damaged part that starts at a byte of the file."""
        self.count += 1
        self.first = self.first or f"at byte {position}: {error}"

    def describe(self) -> str:
        """Returns a phrase for messages; empty without damage."""
        if not self.count:
            return ""
        if self.count == 1:
            return f"1 damaged chunk left out, {self.first}"
        return f"{self.count} damaged chunks left out, the first {self.first}"
