"""Translates topics of PX4's log format ULog to ROS 2 definitions, and their samples to CDR.

Source: "ULog File Format" of PX4's documentation, version 1 of the format.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from hashlib import sha256
from typing import NamedTuple

from volery.bridges.logs.records import LogTopic

_FIELD = re.compile(r"(\w{1,100})(?:\[(\d{1,5})\])? (\w{1,100})", re.ASCII)
_NUMBERS = {
    **{f"{s}int{b}_t": (f"{s}int{b}", b // 8) for s in ("u", "") for b in (8, 16, 32, 64)},
    "float": ("float32", 4),
    "double": ("float64", 8),
    "bool": ("bool", 1),
    "char": ("uint8", 1),
}
"""Types of ROS and sizes, bytes, by ULog's types."""
_MAX_FIELDS = 20_000
"""Largest number of fields of one topic with all that it nests."""
_MAX_BYTES = 1 << 16
"""Largest sample: lengths of ULog's messages have 16 bits."""
_TIME = "timestamp"
US_NS = 1000
_US = struct.Struct("<Q")
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"

TEXTS = LogTopic(
    "/logged_messages",
    "ulog/msg/LoggedMessage",
    "uint8 severity\nstring text\n",
    "cdr",
    "ros2msg",
)
"""Texts that the vehicle logged, with their severity of syslog (0: emergency, 7: debug)."""


class _Leaf(NamedTuple):
    name: str
    ros_type: str
    item_bytes: int
    length: int | None
    """Length of an array; None for a number."""


class UlogTopic:
    """One topic of a ULog: its type for ROS, and how its samples become CDR.

    formats: fields by name of the format, as in the log. Raises `ValueError` if the format is
    missing or invalid.
    """

    def __init__(self, name: str, instance: int, formats: Mapping[str, str]) -> None:
        leaves = list(_leaves(name, formats, "", [0]))
        self._time_at = -1
        self._copies: list[tuple[slice, slice]] = []
        source = target = 0
        lines = []
        for leaf in leaves:
            size = leaf.item_bytes * (1 if leaf.length is None else leaf.length)
            if source + size > _MAX_BYTES:
                raise ValueError(
                    f"samples of topic '{name}' would have more than {_MAX_BYTES} bytes"
                )
            if leaf.name == _TIME and leaf.ros_type == "uint64":
                self._time_at = source
            if not leaf.name.startswith("_padding"):
                target += -target % leaf.item_bytes
                self._copies.append((slice(source, source + size), slice(target, target + size)))
                array = "" if leaf.length is None else f"[{leaf.length}]"
                lines.append(f"{leaf.ros_type}{array} {leaf.name}\n")
                target += size
            source += size
        if self._time_at < 0:
            raise ValueError(f"topic '{name}' has no field 'uint64_t {_TIME}'")
        self._size = self._copies[-1][0].stop
        self._empty = bytes(target)
        text = "".join(lines)
        # PX4's topics change between versions, and types of one name cannot
        package = f"ulog_{sha256(text.encode()).hexdigest()[:8]}"
        number = f"_{instance}" if instance else ""
        if name + number in formats and number:  # the name of another topic
            number = f"/{instance}"
        self.topic = LogTopic(
            f"/{name}{number}", f"{package}/msg/{_camel(name)}", text, "cdr", "ros2msg"
        )

    def time_ns(self, data: bytes) -> int | None:
        """Returns the time of a sample since the vehicle's start, ns; None if it is too short."""
        if len(data) < self._size:
            return None
        return int(_US.unpack_from(data, self._time_at)[0]) * US_NS

    def cdr(self, data: bytes) -> bytes:
        """Returns a sample as CDR."""
        packed = bytearray(self._empty)
        for source, target in self._copies:
            packed[target] = data[source]
        return _LITTLE_ENDIAN + bytes(packed)


def text_cdr(severity: int, text: bytes) -> bytes:
    """Returns a logged text as CDR of the type of `TEXTS`."""
    clean = text.decode(errors="replace").replace("\0", "").encode() + b"\0"
    return _LITTLE_ENDIAN + struct.pack("<B3xI", severity, len(clean)) + clean


def _leaves(
    name: str, formats: Mapping[str, str], prefix: str, visits: list[int], depth: int = 0
) -> Iterator[_Leaf]:
    """Yields numbers and arrays of a format; names of nested fields are joined by underscores."""
    if name not in formats or depth > 8:
        raise ValueError(f"format '{name}' is missing or nested too deep")
    for text in filter(None, formats[name].split(";")):
        found = _FIELD.fullmatch(text.strip())
        if found is None:
            raise ValueError(f"format '{name}' has the invalid field '{text[:100]}'")
        kind, count, field = found[1], None if found[2] is None else int(found[2]), found[3]
        number = _NUMBERS.get(kind)
        indices = [""] if count is None or number else [f"_{k}" for k in range(count)]
        for index in indices:
            visits[0] += 1
            if visits[0] > _MAX_FIELDS:
                raise ValueError(f"format '{name}' has more than {_MAX_FIELDS} fields")
            if number is None:
                yield from _leaves(kind, formats, f"{prefix}{field}{index}_", visits, depth + 1)
            elif count != 0:
                yield _Leaf(prefix + field, *number, count)


def _camel(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))[:60]
