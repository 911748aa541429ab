"""Finds where a damaged ULog can be read again, by its synchronization messages.

Source: "ULog File Format" of PX4's documentation, messages 'S' (synchronization).
"""

from __future__ import annotations

import struct
from typing import BinaryIO

import numpy as np

from volery.core.plurals import counted

HEAD = struct.Struct("<HB")
"""Head of a message: length of the payload, kind."""
KINDS = frozenset(b"ABCDFILMOPQRS")
"""Kinds of messages that the format defines."""
_LETTERS = frozenset(range(0x21, 0x7F))
"""Printable characters, of which a kind is one."""
SYNC = HEAD.pack(8, ord("S")) + bytes.fromhex("2f731320250cbb12")
"""A whole synchronization message."""

_BLOCK_BYTES = 1 << 16
_CHAIN = 8
"""Messages in a row that show, without a synchronization message, where messages begin."""
_MAX_DAMAGES = 1000
"""Largest number of damaged places of one log, which bounds the time of the search."""
_IS_KIND = np.isin(np.arange(256), list(KINDS))


class UlogRecovery:
    """Finds the next messages after damaged bytes, and describes the damage of one reading."""

    def __init__(self) -> None:
        self._damaged_at: list[int] = []
        self._skipped = 0
        self._has_sync = True

    @property
    def problem(self) -> str:
        """The damage so far; empty without any."""
        if not self._damaged_at:
            return ""
        where = f"damaged at byte {self._damaged_at[0]}"
        if len(self._damaged_at) > 1:
            where = f"damaged at {len(self._damaged_at)} places, the first at byte "
            where += str(self._damaged_at[0])
        return f"{where}: {counted(self._skipped, 'byte')} skipped"

    def resume(self, file: BinaryIO, begin: int, end: int) -> int:
        """Returns the position of the next readable message after the damage at `begin`.

        end: where to stop searching, which is returned if nothing is readable before.
        """
        self._damaged_at.append(begin)
        found = end
        if len(self._damaged_at) <= _MAX_DAMAGES:
            found = self._after_damage(file, begin + 1, end)
        self._skipped += found - begin
        return found

    def has_sync(self, file: BinaryIO, begin: int, end: int) -> bool:
        """Returns whether a synchronization message lies between two positions."""
        return self._has_sync and _find_sync(file, begin, end) is not None

    def _after_damage(self, file: BinaryIO, begin: int, end: int) -> int:
        sync = _find_sync(file, begin, end) if self._has_sync else None
        if sync is not None:
            start = max(begin, sync - _BLOCK_BYTES)
            return start + _first_message(_bytes(file, start, sync), None, is_end=True)
        self._has_sync = False
        for start in range(begin, end, _BLOCK_BYTES):
            stop = min(start + 2 * _BLOCK_BYTES, end)
            found = _first_message(_bytes(file, start, stop), _CHAIN, is_end=stop == end)
            if found < min(_BLOCK_BYTES, stop - start):
                return start + found
        return end


def after_unknown_kinds(file: BinaryIO, begin: int, end: int) -> int | None:
    """Returns the position after whole messages of undefined kinds; None if they are damage.

    Readers skip kinds that later versions of the format define. Such messages have a printable
    letter, and lead to a defined message that leads to another, or to `end`; a synchronization
    message within one shows that its length is damaged.
    """
    position = begin
    while (head := _head(file, position, end)) is not None:
        length, kind = head
        if kind in KINDS:
            after = _head(file, position + HEAD.size + length, end)
            return None if after is not None and after[1] not in _LETTERS else position
        if kind not in _LETTERS or SYNC in file.read(length):
            return None
        position += HEAD.size + length
    return position if position <= end else None


def _head(file: BinaryIO, position: int, end: int) -> tuple[int, int] | None:
    """Returns length and kind of the message at a position; None if it has no whole head."""
    if position + HEAD.size > end:
        return None
    length, kind = HEAD.unpack(_bytes(file, position, position + HEAD.size))
    return length, kind


def _first_message(data: bytes, chain: int | None, *, is_end: bool) -> int:
    """Returns the first position from which whole messages follow; the length of `data` if none.

    chain: so many messages are enough. is_end: messages up to the end of `data` are enough, too.
    """
    if len(data) < HEAD.size:
        return len(data)
    octets = np.frombuffer(data, np.uint8)
    starts = np.flatnonzero(_IS_KIND[octets[2:]])
    ends = starts + HEAD.size + octets[starts] + octets[starts + 1].astype(np.int64) * 256
    enough = len(data) if chain is None else chain
    followers = {len(data): enough} if is_end else {}
    found = len(data)
    for start, end in zip(starts[::-1].tolist(), ends[::-1].tolist(), strict=True):
        if end > len(data):
            continue
        followers[start] = count = followers.get(end, 0) + 1
        if count >= enough:
            found = start
    return found


def _find_sync(file: BinaryIO, begin: int, end: int) -> int | None:
    """Returns the position of the next synchronization message; None if there is none."""
    for start in range(begin, end, _BLOCK_BYTES):
        stop = min(start + _BLOCK_BYTES + len(SYNC) - 1, end)
        found = _bytes(file, start, stop).find(SYNC)
        if found >= 0:
            return start + found
    return None


def _bytes(file: BinaryIO, begin: int, end: int) -> bytes:
    file.seek(begin)
    return file.read(end - begin)
