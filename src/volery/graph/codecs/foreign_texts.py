"""Reads texts of other writers, which the decoders that `rosbags` generates refuse.

As in rclpy, bytes that are not UTF-8 (Latin-1 in names, say) become U+FFFD. As in Fast CDR, a CDR
string of length 0, without a terminator, is empty.
"""

from __future__ import annotations

from typing import Any

from rosbags.serde.utils import check_string


class _Text(bytes):
    """The bytes of a text."""

    def decode(self, *_: Any) -> str:
        """Returns the text, with U+FFFD for what is not UTF-8."""
        return bytes.decode(self, "utf-8", "replace")


def _check_string(rawdata: Any, pos: int, size: int, *, cdr: bool) -> None:
    """Raises `SerdeError` for a length beyond the data, or a missing terminator."""
    if size or not cdr:
        check_string(rawdata, pos, size, cdr=cdr)


def read_foreign_texts(decode: Any) -> Any:
    """Returns a generated decoder, changed to read such texts."""
    decode.__globals__.update(bytes=_Text, check_string=_check_string)
    return decode
