"""Formats counts with singular and plural."""

from __future__ import annotations


def counted(number: int, thing: str, things: str | None = None) -> str:
    """Returns `1 scan`, `1,600 scans`; things: a plural other than with s."""
    return f"{number:,} {thing if number == 1 else things or f'{thing}s'}"
