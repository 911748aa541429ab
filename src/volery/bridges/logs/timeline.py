"""Orders a log on one time line, even if its own time went back.

A flight that was reset, or restored from a snapshot, has some times twice. On the time line the
messages after such a step follow those before it: their times are shifted by the step. A log
without steps keeps its own times.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Set
from functools import partial
from typing import NamedTuple

from volery.bridges.logs.chunks import Chunk, ChunkedLog
from volery.bridges.logs.content import Content, Head
from volery.bridges.logs.records import LogRecord
from volery.core.clock import NS_PER_S

_JUMP_NS = NS_PER_S // 10
"""Messages may be out of order by less (modelling choice): publishers have their own clocks."""
_FOREVER_NS = 1 << 62
_MAX_FRUITLESS = 64
"""Chunks read in search of messages that their index announces and that are not in them."""


class _Piece(NamedTuple):
    """Messages `first` to before `last` of a chunk (None: its end), and their times on the line."""

    chunk: Chunk
    first: int
    last: int | None
    shift_ns: int
    start_ns: int
    end_ns: int
    """Latest time on the line up to here, which never decreases."""


class TimelinePosition(NamedTuple):
    """Position of a message on the line: piece, and message in it."""

    piece: int
    message: int


class Shown(NamedTuple):
    """A message, its time on the line, and the number of its channel."""

    time_ns: int
    channel: int
    record: LogRecord


class Passage(NamedTuple):
    """Some messages, the position after them, and whether they were the last ones there."""

    shown: list[Shown]
    position: TimelinePosition
    over: bool


class Timeline:
    """Returns the messages of a log in order, or from any time on."""

    def __init__(self, log: ChunkedLog) -> None:
        self.log = log
        self._pieces = _pieces_of(log)
        self._ends = [piece.end_ns for piece in self._pieces]
        self.start_ns = min((piece.start_ns for piece in self._pieces), default=0)
        self.end_ns = self._ends[-1] if self._pieces else 0

    @property
    def end(self) -> TimelinePosition:
        """Position after the last message."""
        return TimelinePosition(len(self._pieces), 0)

    def shift_ns(self, position: TimelinePosition) -> int:
        """Returns the offset of the line to the log's own time, before a position."""
        number = min(position.piece, len(self._pieces) - 1)
        at_its_start = number == position.piece and position.message <= self._pieces[number].first
        return self._pieces[max(number - at_its_start, 0)].shift_ns

    def after(self, time_ns: int) -> TimelinePosition:
        """Returns the position of the first message that is later than `time_ns`."""
        number = bisect_left(self._ends, time_ns + 1)
        position = TimelinePosition(number, 0)
        for _ in range(_MAX_FRUITLESS):
            passage = self.take(position, time_ns, frozenset())
            position = passage.position
            if passage.over:
                break
        return position

    def take(self, position: TimelinePosition, until_ns: int, channels: Set[int]) -> Passage:
        """Returns messages of `channels` from a position on, up to `until_ns`, at most one chunk.

        At most one chunk is read, even if an index announces messages that are not in it.
        """
        shown: list[Shown] = []
        number, message = position
        while number < len(self._pieces):
            piece = self._pieces[number]
            if piece.end_ns > until_ns or not channels.isdisjoint(piece.chunk.counts):
                content = self.log.content(piece.chunk)
                shift_ns = piece.shift_ns
                heads = content.heads if piece.last is None else content.heads[: piece.last]
                for k in range(max(message, piece.first), len(heads)):
                    head = heads[k]
                    if head.time_ns + shift_ns > until_ns:
                        return Passage(shown, TimelinePosition(number, k), over=True)
                    if head.channel in channels:
                        record = self.log.record(content, head)
                        shown.append(Shown(head.time_ns + shift_ns, head.channel, record))
                number, message = number + 1, 0
                break
            number, message = number + 1, 0
        return Passage(shown, TimelinePosition(number, 0), over=number == len(self._pieces))

    def last_before(self, position: TimelinePosition, channels: Set[int]) -> list[Shown]:
        """Returns the last message of each channel before a position, in the order of the log."""
        missing = set(channels)
        found: list[Shown] = []
        fruitless = 0
        for piece, content, heads in self._backwards(position):
            if not missing or fruitless > _MAX_FRUITLESS:
                break
            if missing.isdisjoint(piece.chunk.counts):
                continue
            fruitless += 1
            for head in reversed(heads()):
                if head.channel in missing:
                    fruitless = 0
                    missing.discard(head.channel)
                    record = self.log.record(content(), head)
                    found.append(Shown(head.time_ns + piece.shift_ns, head.channel, record))
        return found[::-1]

    def since(self, position: TimelinePosition, time_ns: int, channels: Set[int]) -> list[Shown]:
        """Returns all messages of `channels` before a position and after `time_ns`, in order."""
        found: list[Shown] = []
        fruitless = 0
        for piece, content, heads in self._backwards(position):
            if piece.end_ns <= time_ns or fruitless > _MAX_FRUITLESS:
                break
            if channels.isdisjoint(piece.chunk.counts):
                continue
            fruitless += 1
            for head in reversed(heads()):
                at_ns = head.time_ns + piece.shift_ns
                if head.channel in channels and at_ns > time_ns:
                    fruitless = 0
                    found.append(Shown(at_ns, head.channel, self.log.record(content(), head)))
        return found[::-1]

    def _backwards(
        self, position: TimelinePosition
    ) -> Iterator[tuple[_Piece, Callable[[], Content], Callable[[], tuple[Head, ...]]]]:
        """Yields the pieces before a position, the last one first.

        Each piece comes with functions for its content and heads.
        """
        for number in range(min(position.piece, len(self._pieces) - 1), -1, -1):
            piece = self._pieces[number]
            content = partial(self.log.content, piece.chunk)
            last = piece.last
            if number == position.piece:
                last = position.message if last is None else min(last, position.message)
            yield piece, content, partial(_heads, content, piece.first, last)


def _heads(content: Callable[[], Content], first: int, last: int | None) -> tuple[Head, ...]:
    return content().heads[first:last]


def _pieces_of(log: ChunkedLog) -> list[_Piece]:
    """Returns the pieces of the line; scans chunks in which the clock went back."""
    pieces: list[_Piece] = []
    shift_ns, front_ns = 0, -_FOREVER_NS
    for chunk in log.chunks:
        if chunk.start_ns >= front_ns - _JUMP_NS and chunk.falls_ns <= _JUMP_NS:
            front_ns = max(front_ns, chunk.end_ns)
            line = (shift_ns, chunk.start_ns + shift_ns, front_ns + shift_ns)
            pieces.append(_Piece(chunk, 0, None, *line))
        else:
            cut, shift_ns, front_ns = _cut(log, chunk, shift_ns, front_ns)
            pieces += cut
    return pieces


def _cut(
    log: ChunkedLog, chunk: Chunk, shift_ns: int, front_ns: int
) -> tuple[list[_Piece], int, int]:
    """Returns the pieces of a chunk between steps; shift and latest time after them."""
    pieces = []
    first, low_ns = 0, _FOREVER_NS
    for k, head in enumerate(log.content(chunk).heads):
        if head.time_ns < front_ns - _JUMP_NS:
            if k > first:
                line = (shift_ns, low_ns + shift_ns, front_ns + shift_ns)
                pieces.append(_Piece(chunk, first, k, *line))
            shift_ns += front_ns - head.time_ns
            first, front_ns, low_ns = k, head.time_ns, head.time_ns
        front_ns, low_ns = max(front_ns, head.time_ns), min(low_ns, head.time_ns)
    pieces.append(_Piece(chunk, first, None, shift_ns, low_ns + shift_ns, front_ns + shift_ns))
    return pieces, shift_ns, front_ns
