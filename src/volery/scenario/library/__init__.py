"""The shipped scenarios: one TOML file each in this folder."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Returns the names of all shipped scenarios, sorted."""
    return list(_names())


@cache
def _names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def path_of(name: str) -> Path | None:
    """Returns the file of a shipped scenario, or None."""
    return _FOLDER / f"{name}.toml" if name in names() else None


def describe(name: str) -> str:
    """Returns the first line of a shipped scenario's description."""
    data = tomllib.loads((_FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    return str(data.get("description", "")).strip().split("\n")[0]
