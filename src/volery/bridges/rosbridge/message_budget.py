"""Limits the contents of one message of a client, counted before it is decoded.

Both decoders hold Python's lock for a whole message, so the cost of a message must be known first.
Counts are of bytes, not of parsed values: exact for CBOR; for JSON an upper bound, which counts
punctuation inside of texts as structure.

Measured on one core of a 2-core machine (AMD EPYC, Python 3.11), decoding with `json` or `cbor2`
and `graph.codecs.json_decoding` together: 90 to 180 ns a number in a list, .3 to .5 us a member of
an object, 4 to 10 us an object that becomes a message, .4 us a list, 2 ms a MB of base64 text, .1
to .6 ms a MB of a byte string or typed array; counting: .1 ms a MB of JSON, .3 us a value of CBOR
that is inspected by itself. A message within all budgets takes about 40 ms at most.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import BridgeError

MAX_MESSAGE_BYTES = 10_000_000
"""Largest message unless a server has another limit, as `max_message_size` of rosbridge_server. A
WebSocket's message is copied several times: 25 MB would delay other clients by 50 to 100 ms."""
MAX_TEXT_BYTES = 16 * 1024 * 1024
"""Largest message as JSON: 12 MB as base64 text."""
MAX_IMAGE_BYTES = 4 * 1024 * 1024
"""Largest message as JSON inside a PNG image."""
MAX_VALUES = 200_000
"""Largest number of values of all kinds and names of members in one message."""
MAX_MEMBERS = 50_000
"""Largest number of members of all objects together."""
MAX_APART = 50_000
"""Largest number of CBOR values outside of arrays of numbers, which are inspected one by one."""
MAX_CONTAINERS = 5_000
"""Largest number of objects and lists in one message."""
MAX_UNAUTHORIZED_BYTES = 4096
"""Largest first message of a client that has not sent the token yet."""

_SMALL_BYTES = 4_000
"""Size below which a message cannot exceed any budget: each item takes a byte at least."""
_SLICE_BYTES = 1 << 18
_COMMA, _COLON, _OBJECT, _LIST = b",:{["

_BYTE_STRING, _TEXT, _ARRAY, _MAP, _TAG, _SIMPLE = 2, 3, 4, 5, 6, 7
_INDEFINITE = 31
_MIN_RUN = 64
"""Length below which runs of numbers are counted one by one."""


def check_json(text: str) -> None:
    """Raises `BridgeError` for JSON text that exceeds a budget."""
    if len(text) <= _SMALL_BYTES:
        return
    _check(len(text), MAX_TEXT_BYTES, "bytes as JSON")
    data = np.frombuffer(text.encode(errors="replace"), np.uint8)
    commas = colons = containers = 0
    for start in range(0, len(data), _SLICE_BYTES):
        piece = data[start : start + _SLICE_BYTES]
        commas += int(np.count_nonzero(piece == _COMMA))
        colons += int(np.count_nonzero(piece == _COLON))
        containers += int(np.count_nonzero((piece == _OBJECT) | (piece == _LIST)))
        _check_counts(commas + colons, colons, containers)


def check_cbor(data: bytes) -> None:
    """Raises `BridgeError` for CBOR that exceeds a budget.

    Invalid CBOR passes up to the error; the decoder fails at the same byte.
    """
    if len(data) > _SMALL_BYTES:
        _Walk(data).check()


class _Walk:
    """One pass over the heads of CBOR items, linear in their number, without recursion."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._bytes: NDArray[np.uint8] = np.frombuffer(data, np.uint8)
        self._values = self._members = self._containers = self._apart = 0

    def check(self) -> None:
        """Counts everything. Raises `BridgeError` beyond a budget."""
        data, end, position = self._data, len(self._data), 0
        while position < end:
            head = data[position]
            major, info = head >> 5, head & 31
            width = 0 if info < 24 else 1 << (info - 24) if info < 28 else 0
            start, position = position + 1, position + 1 + width
            number = int.from_bytes(data[start:position], "big") if width else info
            self._values += 1
            self._apart += 1
            if major in (_BYTE_STRING, _TEXT) and info != _INDEFINITE:
                position += number
            elif major in (_ARRAY, _MAP):
                self._containers += 1
                if info != _INDEFINITE:
                    self._announced(number, major)
                if major == _ARRAY and number >= _MIN_RUN and info != _INDEFINITE:
                    position = self._pass_numbers(position, number)
            if not self._apart % 1000 or self._containers > MAX_CONTAINERS:
                self._check()
        self._check()

    def _announced(self, number: int, major: int) -> None:
        """Counts the announced items of a container before they are inspected."""
        if major == _MAP:
            self._members += number
        _check(self._values + number, MAX_VALUES, "values")

    def _pass_numbers(self, position: int, number: int) -> int:
        """Returns the end of the equally long numbers at the start of an array."""
        if position >= len(self._data):
            return position
        head = self._data[position]
        major, info = head >> 5, head & 31
        if major not in (0, 1, _SIMPLE) or info > 27:
            return position
        if info < 24:
            step, heads = 1, self._bytes[position : position + number]
            like = (heads & 31 < 24) & ((heads >> 5 < 2) | (heads >> 5 == _SIMPLE))
        else:
            step = 1 + (1 << (info - 24))
            heads = self._bytes[position : position + number * step : step]
            like = heads == head
        unlike = np.flatnonzero(~like)
        passed = int(unlike[0]) if len(unlike) else len(heads)
        self._values += passed
        return position + passed * step

    def _check(self) -> None:
        _check(self._apart, MAX_APART, "values outside of arrays of equally long numbers")
        _check_counts(self._values, self._members, self._containers)


def _check_counts(values: int, members: int, containers: int) -> None:
    _check(containers, MAX_CONTAINERS, "objects and lists")
    _check(members, MAX_MEMBERS, "members of objects")
    _check(values, MAX_VALUES, "values")


def _check(found: Any, limit: int, what: str) -> None:
    if found > limit:
        raise BridgeError(
            f"a message holds more than {limit:,} {what}; send numbers as base64 text or as typed "
            "arrays of CBOR, or several messages (docs/bridges.md, limits of messages)"
        )
