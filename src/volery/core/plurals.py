"""Numbers of things in words."""

from __future__ import annotations


def counted(number: int, thing: str, things: str | None = None) -> str:
    """`1 scan`, `1,600 scans`; things: the plural that takes more than an s."""
    return f"{number:,} {thing if number == 1 else things or f'{thing}s'}"
