"""Payloads of the frames that stations and server exchange about the messages.

Numbers are little-endian and packed; `text` is a u8 length and so many bytes of UTF-8.

HELLO (1), station to server, its first frame: u16 batch · u16 plane · u16 planes_per_batch · text
name · text token. The head's source is the linear id, its session that of all messages to come.

WELCOME (2): u32 boot, drawn by the server when it started · u32 last, the highest sequence that it
has of this session · then u32 each: those up to `last` that are not settled yet.

REFUSAL (3): u8 reason, see `Reason` · u32 sequence of the refused message, 0: the connection itself
· the rest is UTF-8 for people.

RECEIVED (4), station to server: 10 bytes each: u16 source · u32 session · u32 sequence: all that
this source sent here up to this sequence has come.

SETTLED (5), server to station: u32 each: sequences of messages with which the server is done: every
station that they were meant for has told that they came, or a rule has disposed of them.

PING (6) and PONG (7): empty.
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
MOST_SEQUENCES = 4000
"""In one frame, so that it stays below the limit of payloads."""


class Reason(IntEnum):
    """Why the server refuses."""

    IDENTITY = 1
    """Batch, plane and address do not fit each other."""
    BATCH_SIZE = 2
    """The station counts other planes a batch than the server."""
    TOKEN = 3
    REPLACED = 4
    """Somebody else came with the same identity; the newest wins."""
    PROTOCOL = 5
    """Something other than HELLO first, a forged source, too many corrupt frames."""
    UNKNOWN = 6
    """No such station has ever been here."""
    FULL = 7
    """Too many commands wait for that station already."""
    RATE = 8
    """More messages than the rate that is allowed."""
    EXPIRED = 9
    """The station did not come back in time."""


class Hello(NamedTuple):
    """A station's first words."""

    batch: int
    plane: int
    planes_per_batch: int
    name: str
    token: str


class Welcome(NamedTuple):
    """The server's answer."""

    boot: int
    last: int
    unsettled: tuple[int, ...]


class Refusal(NamedTuple):
    """What the server does not do; sequence 0: it speaks of the connection."""

    reason: Reason
    sequence: int
    text: str


class Received(NamedTuple):
    """Up to where one source's messages have come."""

    source: int
    session: int
    sequence: int


def encode_hello(hello: Hello) -> bytes:
    """Payload of a HELLO. `CommsError` for texts above 255 bytes."""
    texts = b""
    for text in (hello.name, hello.token):
        data = text.encode()
        if len(data) > _LONGEST_TEXT_BYTES:
            raise CommsError(f"'{text[:40]}...' is longer than {_LONGEST_TEXT_BYTES} bytes")
        texts += bytes((len(data),)) + data
    return _HELLO.pack(hello.batch, hello.plane, hello.planes_per_batch) + texts


def decode_hello(payload: bytes) -> Hello:
    """A HELLO's payload. `CommsError` where it is none."""
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
        raise IndexError("it ends within a text")
    return data[1:end].decode(), data[end:]


def encode_welcome(welcome: Welcome) -> bytes:
    """Payload of a WELCOME."""
    head = _WELCOME.pack(welcome.boot, welcome.last)
    return head + encode_settled(welcome.unsettled)


def decode_welcome(payload: bytes) -> Welcome:
    """A WELCOME's payload. `CommsError` where it is none."""
    if len(payload) < _WELCOME.size:
        raise CommsError(f"not a WELCOME: {len(payload)} bytes")
    boot, last = _WELCOME.unpack_from(payload)
    return Welcome(boot, last, decode_settled(payload[_WELCOME.size :]))


def encode_refusal(refusal: Refusal) -> bytes:
    """Payload of a REFUSAL."""
    return _REFUSAL.pack(refusal.reason, refusal.sequence) + refusal.text.encode()


def decode_refusal(payload: bytes) -> Refusal:
    """A REFUSAL's payload. `CommsError` where it is none."""
    try:
        reason, sequence = _REFUSAL.unpack_from(payload)
        text = payload[_REFUSAL.size :].decode(errors="replace")
        return Refusal(Reason(reason), sequence, text)
    except (struct.error, ValueError) as error:
        raise CommsError(f"not a REFUSAL: {error}") from None


def encode_received(entries: Iterable[Received]) -> bytes:
    """Payload of a RECEIVED."""
    return b"".join(_RECEIVED.pack(*entry) for entry in entries)


def decode_received(payload: bytes) -> Iterator[Received]:
    """Entries of a RECEIVED. `CommsError` where the length does not fit."""
    if len(payload) % _RECEIVED.size:
        raise CommsError(f"not a RECEIVED: {len(payload)} bytes")
    return map(Received._make, _RECEIVED.iter_unpack(payload))


def encode_settled(sequences: Iterable[int]) -> bytes:
    """Payload of a SETTLED."""
    numbers = tuple(sequences)
    return struct.pack(f"<{len(numbers)}I", *numbers)


def decode_settled(payload: bytes) -> tuple[int, ...]:
    """Sequences of a SETTLED. `CommsError` where the length does not fit."""
    if len(payload) % 4:
        raise CommsError(f"not a SETTLED: {len(payload)} bytes")
    return struct.unpack(f"<{len(payload) // 4}I", payload)
