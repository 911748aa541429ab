"""Payloads of the control frames between stations and server; docs/comms.md defines their fields.

Numbers are little-endian and packed; `text` is a u8 length and so many bytes of UTF-8. In HELLO the
head's source is the linear id, and its session that of all messages to come.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import NamedTuple

from volery.core.errors import CommsError

_HELLO = struct.Struct("<HHH")
_WELCOME = struct.Struct("<II")
_REFUSAL = struct.Struct("<BI")
_RECEIVED = struct.Struct("<HII")
_LONGEST_TEXT_BYTES = 255
MAX_SEQUENCES = 4000
"""Max number in one frame, below the limit of payloads."""


class Reason(IntEnum):
    """Reason of a refusal."""

    IDENTITY = 1
    """Batch, plane and address do not match."""
    BATCH_SIZE = 2
    """The station's number of planes per batch differs from the server's."""
    TOKEN = 3
    REPLACED = 4
    """Another station connected with the same identity; the newest one replaces the others."""
    PROTOCOL = 5
    """The first frame was not HELLO, a source was forged, or too many frames were corrupt."""
    UNKNOWN = 6
    """No such station has connected."""
    FULL = 7
    """Too many commands wait for that station."""
    RATE = 8
    """The message exceeds the allowed rate."""
    EXPIRED = 9
    """The station did not reconnect in time."""


class Hello(NamedTuple):
    """First frame of a station."""

    batch: int
    plane: int
    group_size: int
    name: str
    token: str


class Welcome(NamedTuple):
    """Response of the server to HELLO."""

    boot: int
    last: int
    unsettled: tuple[int, ...]


class Refusal(NamedTuple):
    """A refused message; sequence 0: the connection is refused."""

    reason: Reason
    sequence: int
    text: str


class Received(NamedTuple):
    """Last received message of one source."""

    source: int
    session: int
    sequence: int


def encode_hello(hello: Hello) -> bytes:
    """Returns the payload of a HELLO. Raises CommsError for texts above 255 bytes."""
    texts = b""
    for text in (hello.name, hello.token):
        data = text.encode()
        if len(data) > _LONGEST_TEXT_BYTES:
            raise CommsError(f"'{text[:40]}...' is longer than {_LONGEST_TEXT_BYTES} bytes")
        texts += bytes((len(data),)) + data
    return _HELLO.pack(hello.batch, hello.plane, hello.group_size) + texts


def decode_hello(payload: bytes) -> Hello:
    """Returns the HELLO of a payload. Raises CommsError if it is invalid."""
    try:
        batch, plane, planes = _HELLO.unpack_from(payload)
        name, rest = _text(payload[_HELLO.size :])
        token, rest = _text(rest)
    except (struct.error, IndexError, UnicodeDecodeError) as error:
        raise CommsError(f"not a HELLO: {error}") from None
    if rest:
        raise CommsError(f"not a HELLO: {len(rest)} bytes too many")
    return Hello(batch, plane, planes, name, token)


def _text(data: bytes) -> tuple[str, bytes]:
    end = 1 + data[0]
    if end > len(data):
        raise IndexError("the payload ends within a text")
    return data[1:end].decode(), data[end:]


def encode_welcome(welcome: Welcome) -> bytes:
    """Returns the payload of a WELCOME."""
    head = _WELCOME.pack(welcome.boot, welcome.last)
    return head + encode_settled(welcome.unsettled)


def decode_welcome(payload: bytes) -> Welcome:
    """Returns the WELCOME of a payload. Raises CommsError if it is invalid."""
    if len(payload) < _WELCOME.size:
        raise CommsError(f"not a WELCOME: {len(payload)} bytes")
    boot, last = _WELCOME.unpack_from(payload)
    return Welcome(boot, last, decode_settled(payload[_WELCOME.size :]))


def encode_refusal(refusal: Refusal) -> bytes:
    """Returns the payload of a REFUSAL."""
    return _REFUSAL.pack(refusal.reason, refusal.sequence) + refusal.text.encode()


def decode_refusal(payload: bytes) -> Refusal:
    """Returns the REFUSAL of a payload. Raises CommsError if it is invalid."""
    try:
        reason, sequence = _REFUSAL.unpack_from(payload)
        text = payload[_REFUSAL.size :].decode(errors="replace")
        return Refusal(Reason(reason), sequence, text)
    except (struct.error, ValueError) as error:
        raise CommsError(f"not a REFUSAL: {error}") from None


def encode_received(entries: Iterable[Received]) -> bytes:
    """Returns the payload of a RECEIVED."""
    return b"".join(_RECEIVED.pack(*entry) for entry in entries)


def decode_received(payload: bytes) -> Iterator[Received]:
    """Returns the entries of a RECEIVED. Raises CommsError if the length is invalid."""
    if len(payload) % _RECEIVED.size:
        raise CommsError(f"not a RECEIVED: {len(payload)} bytes")
    return map(Received._make, _RECEIVED.iter_unpack(payload))


def encode_settled(sequences: Iterable[int]) -> bytes:
    """Returns the payload of a SETTLED."""
    numbers = tuple(sequences)
    return struct.pack(f"<{len(numbers)}I", *numbers)


def decode_settled(payload: bytes) -> tuple[int, ...]:
    """Returns the sequences of a SETTLED. Raises CommsError if the length is invalid."""
    if len(payload) % 4:
        raise CommsError(f"not a SETTLED: {len(payload)} bytes")
    return struct.unpack(f"<{len(payload) // 4}I", payload)
