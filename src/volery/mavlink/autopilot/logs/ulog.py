"""Writes PX4's log format ULog: each function returns the bytes of one part of a log.

Source: "ULog File Format" of PX4's documentation, version 1 of the format. All numbers are
little-endian; times are microseconds since the start.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from volery.mavlink.autopilot.parameters import Value

_MAGIC = b"ULog\x01\x12\x35\x01"
_FLAG_BITS = bytes(40)
"""No feature that a reader must support, no data appended."""
_MESSAGE = struct.Struct("<HB")
_FIELD = re.compile(r"(\w+?)(?:\[(\d+)\])? (\w+)")
_CODES = {
    "bool": "?",
    "uint8_t": "B",
    "uint16_t": "H",
    "int32_t": "i",
    "uint32_t": "I",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
}


class UlogTopic:
    """One kind of sample: its name in a log and its fields, in the order of the values.

    fields: such as "uint64_t timestamp; float[4] q"; the first one is the timestamp.
    """

    def __init__(self, number: int, name: str, fields: str) -> None:
        self.name = name
        parts = [part.strip() for part in fields.split(";")]
        self._format = f"{name}:{';'.join(parts)};"
        codes = "".join(_code_of(part) for part in parts)
        self._number = number
        self._values = struct.Struct(f"<HBH{codes}")
        self._size = self._values.size - _MESSAGE.size

    def definition(self) -> bytes:
        """Returns the message that describes the fields."""
        return _message("F", self._format.encode())

    def subscription(self) -> bytes:
        """Returns the message that assigns a number to the samples."""
        return _message("A", struct.pack("<BH", 0, self._number) + self.name.encode())

    def sample(self, values: Sequence[float]) -> bytes:
        """Returns a sample. Raises `struct.error` or `OverflowError` if a value does not fit."""
        return self._values.pack(self._size, _DATA, self._number, *values)


def header(time_us: int) -> bytes:
    """Returns the head of a log that starts at a time."""
    return _MAGIC + struct.pack("<Q", time_us) + _message("B", _FLAG_BITS)


def text_info(key: str, text: str) -> bytes:
    """Returns a text about the whole log, such as `sys_name`."""
    value = text.encode("ascii", "replace")
    return _message("I", _key(f"char[{len(value)}] {key}") + value)


def number_info(key: str, value: int) -> bytes:
    """Returns a number (uint32) about the whole log."""
    return _message("I", _key(f"uint32_t {key}") + struct.pack("<I", value))


def parameter(name: str, value: Value) -> bytes:
    """Returns the value of a parameter, at the start or when it changes."""
    kind = "int32_t" if isinstance(value, int) else "float"
    return _message("P", _key(f"{kind} {name}") + struct.pack(f"<{_CODES[kind]}", value))


def logged_text(severity: int, time_us: int, text: str) -> bytes:
    """Returns a text with its MAV_SEVERITY (0 to 7) and time."""
    head = struct.pack("<BQ", ord("0") + severity, time_us)
    return _message("L", head + text.encode("ascii", "replace"))


def _key(text: str) -> bytes:
    return bytes((len(text),)) + text.encode()


def _message(kind: str, payload: bytes) -> bytes:
    return _MESSAGE.pack(len(payload), ord(kind)) + payload


def _code_of(field: str) -> str:
    found = _FIELD.fullmatch(field)
    assert found is not None, field
    return f"{found[2] or ''}{_CODES[found[1]]}"


_DATA = ord("D")
