"""Reads texts of other writers, which the decoders that `rosbags` generates refuse.

Bytes that are not UTF-8 (Latin-1, as programs in C++ write it) become U+FFFD, as in rclpy. A CDR
string of length 0, without a terminator, is empty, as in Fast CDR.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import FunctionType
from typing import Any

from rosbags.serde.utils import check_string

_DECODERS = ("deserialize_cdr_le", "deserialize_cdr_be", "deserialize_ros1")


class TolerantStore:
    """A typestore with such decoders, for generated code.

    get_coders: `get_msgdef` of another typestore. longest: limit of sequences in CDR.
    """

    def __init__(self, get_coders: Callable[[str], Any], longest: int = 0) -> None:
        self._get_coders = get_coders
        self.max_sequence_length = longest
        """Limit of sequences in CDR, elements."""
        self._made: dict[str, Any] = {}

    def get_msgdef(self, msgtype: str) -> Any:
        """Returns the coders of a type."""
        made = self._made.get(msgtype)
        if made is None:
            coders = self._get_coders(msgtype)
            decoders = {name: _tolerant(getattr(coders, name)) for name in _DECODERS}
            made = self._made[msgtype] = replace(coders, **decoders)
        return made


class _Text(bytes):
    """The bytes of a text."""

    def decode(self, *_: Any) -> str:
        """Returns the text, with U+FFFD for what is not UTF-8."""
        return bytes.decode(self, "utf-8", "replace")


def _check_string(rawdata: Any, pos: int, size: int, *, cdr: bool) -> None:
    """Raises `SerdeError` for a length beyond the data, or a missing terminator."""
    if size or not cdr:
        check_string(rawdata, pos, size, cdr=cdr)


def _tolerant(decode: Any) -> Any:
    """Returns a generated decoder whose calls of `bytes` and `check_string` are those above."""
    scope = {**decode.__globals__, "bytes": _Text, "check_string": _check_string}
    return FunctionType(decode.__code__, scope, decode.__name__)
