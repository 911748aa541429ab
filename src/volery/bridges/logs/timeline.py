"""A log as one line of time, also where its own time went back.

A flight that was reset, or taken back to a kept state, tells some times twice. On the line what
came after such a jump follows what came before: its times are shifted by as much as the clock went
back. A log without jumps keeps its own times.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from typing import NamedTuple

from volery.bridges.logs.chunks import Chunk, ChunkedLog, Content, Head
from volery.bridges.logs.records import LogRecord
from volery.core.clock import NS_PER_S

_JUMP_NS = NS_PER_S // 10
"""Messages may be out of order by less (modelling choice): publishers have their own clocks."""


_FOREVER_NS = 1 << 62


class _Piece(NamedTuple):
    """Messages `first` to before `last` of a chunk (None: to its end), shift, end on the line."""

    chunk: Chunk
    first: int
    last: int | None
    shift_ns: int
    end_ns: int


class Place(NamedTuple):
    """Of a message on the line: piece, and message in it."""

    piece: int
    message: int


class Shown(NamedTuple):
    """A message where it stands on the line."""

    time_ns: int
    place: Place
    head: Head
    content: Content


class Timeline:
    """The messages of a log, one after the other or from any time on."""

    def __init__(self, log: ChunkedLog) -> None:
        self.log = log
        self._pieces = _pieces_of(log)
        self._ends = [piece.end_ns for piece in self._pieces]
        self.start_ns = log.chunks[0].start_ns if self._pieces else 0
        self.end_ns = self._ends[-1] if self._pieces else 0

    @property
    def shifted(self) -> bool:
        """Whether the log's own time went back somewhere."""
        return any(piece.shift_ns for piece in self._pieces)

    def at(self, place: Place) -> Shown | None:
        """The message at a place, or the next one; None at the end."""
        number, message = place
        while number < len(self._pieces):
            piece = self._pieces[number]
            content = self.log.content(piece.chunk)
            last = len(content.heads) if piece.last is None else piece.last
            message = max(message, piece.first)
            if message < last:
                head = content.heads[message]
                return Shown(head.time_ns + piece.shift_ns, Place(number, message), head, content)
            number, message = number + 1, 0
        return None

    def after(self, time_ns: int) -> Place:
        """Place of the first message that is later than `time_ns`."""
        number = bisect_left(self._ends, time_ns + 1)
        shown = self.at(Place(number, 0))
        while shown is not None and shown.time_ns <= time_ns:
            place = shown.place._replace(message=shown.place.message + 1)
            shown = self.at(place)
        return Place(len(self._pieces), 0) if shown is None else shown.place

    def last_before(self, place: Place, channels: Iterable[int]) -> list[LogRecord]:
        """The last message of each channel before a place, in the order of the log."""
        missing = set(channels)
        found: list[LogRecord] = []
        for number in range(min(place.piece, len(self._pieces) - 1), -1, -1):
            piece = self._pieces[number]
            if not missing:
                break
            if missing.isdisjoint(piece.chunk.counts):
                continue
            content = self.log.content(piece.chunk)
            last = len(content.heads) if piece.last is None else piece.last
            if number == place.piece:
                last = min(last, place.message)
            for head in reversed(content.heads[piece.first : last]):
                if head.channel in missing:
                    missing.discard(head.channel)
                    found.append(self.log.record(content, head))
        return found[::-1]


def _pieces_of(log: ChunkedLog) -> list[_Piece]:
    """The pieces of the line."""
    pieces: list[_Piece] = []
    shift_ns, front_ns, before_ns = 0, -_FOREVER_NS, -_FOREVER_NS
    unread = False
    """Whether the last piece is a whole chunk that was not looked through."""
    for chunk in log.chunks:
        if chunk.start_ns >= front_ns - _JUMP_NS:
            before_ns, front_ns = front_ns, max(front_ns, chunk.end_ns)
            pieces.append(_Piece(chunk, 0, None, shift_ns, front_ns + shift_ns))
            unread = True
            continue
        # The clock went back in this chunk, or in the one before: both are looked through.
        doubtful = [chunk]
        if unread:
            doubtful.insert(0, pieces.pop().chunk)
            front_ns = before_ns
        for each in doubtful:
            cut, shift_ns, front_ns = _cut(log, each, shift_ns, front_ns)
            pieces += cut
        unread = False
    return pieces


def _cut(
    log: ChunkedLog, chunk: Chunk, shift_ns: int, front_ns: int
) -> tuple[list[_Piece], int, int]:
    """Pieces of a chunk between jumps; shift and latest time behind them."""
    pieces = []
    first = 0
    for k, head in enumerate(log.content(chunk).heads):
        if head.time_ns < front_ns - _JUMP_NS:
            if k > first:
                pieces.append(_Piece(chunk, first, k, shift_ns, front_ns + shift_ns))
            shift_ns += front_ns - head.time_ns
            first, front_ns = k, head.time_ns
        front_ns = max(front_ns, head.time_ns)
    pieces.append(_Piece(chunk, first, None, shift_ns, front_ns + shift_ns))
    return pieces, shift_ns, front_ns
