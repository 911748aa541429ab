"""Reads text as programs save it: UTF-8, or UTF-16 as PowerShell and Excel write it."""

from __future__ import annotations

import codecs
from pathlib import Path

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_text(path: Path) -> str:
    """Returns a file's text without its byte order mark, lines as they end in the file.

    Raises `OSError`, and `UnicodeDecodeError` for other encodings.
    """
    return decode_text(path.read_bytes())


def decode_text(data: bytes) -> str:
    """Returns text in UTF-8, or in UTF-16 with a byte order mark; the mark is left out.

    Raises `UnicodeDecodeError` for other encodings.
    """
    return data.decode("utf-16" if data.startswith(_UTF_16) else "utf-8-sig")
