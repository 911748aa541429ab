"""The wire format of Unity's ROS-TCP-Connector and ROS-TCP-Endpoint, version 0.7.

A frame is `u32le length | destination, UTF-8 | u32le length | payload`, without magic or checksum.
The destination is a topic, a service, or a command `__name` whose payload is JSON. Eight zero
bytes, an empty frame, are a keepalive.

ROS 2 versions of the Connector end destinations and JSON in a NUL that the lengths include.

Source: ROS-TCP-Connector and ROS-TCP-Endpoint v0.7.0, `ROSConnection.cs`, `SysCommand.cs`,
`client.py`, `tcp_sender.py`.
"""

from __future__ import annotations

import json
import mmap
from collections.abc import Sequence
from struct import Struct
from typing import Any, Literal, NamedTuple

import numpy as np

from volery.core.errors import BridgeError

Generation = Literal["ros1", "ros2"]
Bytes = bytes | bytearray | memoryview

KEEPALIVE = bytes(8)
QUEUE_SIZE = "queue_size"
"""Feature: `__subscribe` may have a `queue_size`, the number of messages that may wait."""
REMOVE = "remove"
"""Feature: `__remove_subscriber` and similar commands are supported."""
RESPONSE_ERROR = "response_error"
"""Feature: `__response` may have an `error`, the reason of a service's failure."""
MAX_PAYLOAD_BYTES = 64 << 20
MAX_DESTINATION_BYTES = 4096
MAX_JSON_BYTES = 1 << 20

_VERSION = "v0.7.0"
_LENGTH = Struct("<I")
_SCRATCH_BYTES = 64 << 10
_APART_BYTES = 16 << 10
"""Size above which an incomplete payload is received into its own memory, without a copy."""
_HUGE_PAGES_BYTES = 4 << 20
"""Size from which numpy requests huge pages, for which the system compacts memory: up to 30 ms per
page, in which no other client is served."""


class RosTcpFrame(NamedTuple):
    """One frame; the payload may be stored, because it is not written any more."""

    destination: str
    payload: Bytes


class RosTcpFrameParser:
    """Cuts a stream of bytes into frames.

    The caller writes bytes to `space` and reports their number to `written`. The work is linear in
    them, and memory is what really arrived, whatever length a frame claims.
    """

    def __init__(
        self,
        max_payload: int = MAX_PAYLOAD_BYTES,
        max_destination: int = MAX_DESTINATION_BYTES,
    ) -> None:
        if max_destination > _SCRATCH_BYTES // 4:
            raise BridgeError(f"destinations are limited to {_SCRATCH_BYTES // 4} bytes")
        self._max_payload = max_payload
        self._max_destination = max_destination
        self._scratch = memoryview(bytearray(_SCRATCH_BYTES))
        self._start = 0
        self._end = 0
        self._destination_bytes: int | None = None
        self._destination: str | None = None
        self._payload_bytes: int | None = None
        self._apart: memoryview | None = None
        self._filled = 0
        self.keepalives = 0
        """Number of keepalives."""

    @property
    def num_incomplete(self) -> int:
        """Number of bytes of an incomplete frame."""
        return self._end - self._start if self._apart is None else self._filled

    def space(self) -> memoryview:
        """Returns where to write the next bytes; never empty."""
        if self._apart is not None:
            return self._apart[self._filled :]
        return self._scratch[self._end :]

    def written(self, count: int) -> list[RosTcpFrame]:
        """Returns the frames that are complete after `count` more bytes.

        Raises `BridgeError` for a frame over the limits: the rest cannot be parsed.
        """
        frames: list[RosTcpFrame] = []
        if self._apart is not None:
            self._filled += count
            if self._filled < len(self._apart):
                return frames
            payload, self._apart = self._apart.toreadonly(), None
            self._finish(payload, frames)
            return frames
        self._end += count
        while self._advance(frames):
            pass
        self._compact()
        return frames

    def feed(self, data: Bytes) -> list[RosTcpFrame]:
        """Returns the frames that are complete with `data`. Raises `BridgeError` as `written`."""
        frames: list[RosTcpFrame] = []
        rest = memoryview(data)
        while rest:
            space = self.space()
            count = min(len(space), len(rest))
            space[:count] = rest[:count]
            rest = rest[count:]
            frames += self.written(count)
        return frames

    def end(self) -> None:
        """Drops an incomplete frame and frees its memory at once: no more bytes will arrive."""
        self._apart = None

    def _advance(self, frames: list[RosTcpFrame]) -> bool:
        """Reads the next part of a frame; returns False if bytes are missing."""
        if self._destination_bytes is None:
            self._destination_bytes = self._length("destination", self._max_destination)
            return self._destination_bytes is not None
        if self._destination is None:
            part = self._take(self._destination_bytes)
            if part is not None:
                text = str(part, "utf-8", "replace")
                self._destination = text.rstrip("\0")
            return part is not None
        if self._payload_bytes is None:
            self._payload_bytes = self._length("payload", self._max_payload)
            return self._payload_bytes is not None
        payload = self._take(self._payload_bytes)
        if payload is not None:
            self._finish(bytes(payload), frames)
            return True
        if self._payload_bytes > _APART_BYTES:
            self._begin_apart(self._payload_bytes)
        return False

    def _length(self, what: str, limit: int) -> int | None:
        part = self._take(4)
        if part is None:
            return None
        (length,) = _LENGTH.unpack(part)
        if length > limit:
            where = "" if self._destination is None else f" to '{self._destination[:100]}'"
            raise BridgeError(f"a frame{where} claims a {what} of {length} bytes, over {limit}")
        return int(length)

    def _take(self, count: int) -> memoryview | None:
        if self._end - self._start < count:
            return None
        part = self._scratch[self._start : self._start + count]
        self._start += count
        return part

    def _begin_apart(self, length: int) -> None:
        self._apart = _memory(length)
        self._filled = self._end - self._start
        self._apart[: self._filled] = self._scratch[self._start : self._end]
        self._start = self._end

    def _finish(self, payload: Bytes, frames: list[RosTcpFrame]) -> None:
        destination = self._destination or ""
        if destination or payload:
            frames.append(RosTcpFrame(destination, payload))
        else:
            self.keepalives += 1
        self._destination_bytes = self._destination = self._payload_bytes = None

    def _compact(self) -> None:
        """Moves the rest to the front; it is less than a small payload."""
        left = self._end - self._start
        if self._start and left:
            self._scratch[:left] = bytes(self._scratch[self._start : self._end])
        self._start, self._end = 0, left


def _memory(length: int) -> memoryview:
    """Returns memory that the system provides as it is written."""
    if length < _HUGE_PAGES_BYTES:
        return np.empty(length, np.uint8).data
    return memoryview(mmap.mmap(-1, length))


def head(destination: str, payload_bytes: int) -> bytes:
    """Returns all of a frame before its payload."""
    name = destination.encode()
    return b"".join((_LENGTH.pack(len(name)), name, _LENGTH.pack(payload_bytes)))


def frame(destination: str, payload: Bytes) -> bytes:
    """Returns a whole frame."""
    return head(destination, len(payload)) + payload


def command(name: str, *, nul: bool = False, **fields: Any) -> bytes:
    """Returns the frame of the command `__name`.

    nul: end the JSON in a NUL; a ROS 2 endpoint cuts off the last byte.
    """
    return frame(f"__{name}", json.dumps(fields).encode() + b"\0" * nul)


def handshake(generation: Generation, features: Sequence[str] = ()) -> bytes:
    """Returns the first frame of an endpoint, with its extensions of the protocol.

    Unity's Connector ignores unknown fields of the metadata.
    """
    fields: dict[str, Any] = {"protocol": generation.upper()}
    if features:
        fields["features"] = list(features)
    return command("handshake", version=_VERSION, metadata=json.dumps(fields))


def read_handshake(fields: dict[str, Any]) -> Generation:
    """Returns an endpoint's generation of ROS. Raises `BridgeError` if it is missing."""
    try:
        metadata = json.loads(fields["metadata"])
        protocol = str(metadata["protocol"]).lower()
    except (KeyError, TypeError, ValueError):
        protocol = ""
    if protocol == "ros1":
        return "ros1"
    if protocol == "ros2":
        return "ros2"
    raise BridgeError(f"the endpoint's handshake names neither ROS1 nor ROS2: {fields}")


def read_features(fields: dict[str, Any]) -> frozenset[str]:
    """Returns an endpoint's extensions of the protocol, from the fields of its handshake."""
    try:
        features = json.loads(fields["metadata"])["features"]
    except (KeyError, TypeError, ValueError):
        return frozenset()
    if not isinstance(features, list):
        return frozenset()
    return frozenset(feature for feature in features if isinstance(feature, str))


def read_fields(payload: Bytes) -> dict[str, Any]:
    """Returns the fields of a command. Raises `BridgeError` if they are no JSON object."""
    if len(payload) > MAX_JSON_BYTES:
        raise BridgeError(f"{len(payload)} bytes of JSON, over {MAX_JSON_BYTES}")
    try:
        fields = json.loads(str(payload, "utf-8").rstrip("\0") or "{}")
    except (ValueError, RecursionError) as error:
        raise BridgeError(f"invalid JSON: {error}") from None
    if not isinstance(fields, dict):
        raise BridgeError("no JSON object")
    return fields


def text_field(fields: dict[str, Any], name: str) -> str:
    """Returns a required text, not empty. Raises `BridgeError` otherwise."""
    value = fields.get(name)
    if not isinstance(value, str) or not value:
        raise BridgeError(f"'{name}' is missing or not text")
    return value


def number_field(fields: dict[str, Any], name: str) -> int:
    """Returns a required whole number. Raises `BridgeError` otherwise."""
    value = fields.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise BridgeError(f"'{name}' is missing or not a whole number")
    return value
