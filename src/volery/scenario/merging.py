"""Merges changes into nested tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def merged(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns `data` with `changes`: tables merge key by key, all else (lists too) is replaced.

    A table of another `kind` replaces the whole table, because its keys differ.
    """
    result = dict(data)
    for key, change in changes.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(change, Mapping) and _same_kind(old, change):
            result[key] = merged(old, change)
        else:
            result[key] = change
    return result


def _same_kind(old: Mapping[str, Any], change: Mapping[str, Any]) -> bool:
    return "kind" not in change or bool(change["kind"] == old.get("kind"))
