"""File names in scenarios, adapted when a scenario moves to another folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_KEYS = ("airframe", "field", "file", "identified_model", "message_packages", "model")
"""Keys that name files, or parts that are shipped or in files."""


def moved(data: Mapping[str, Any], old: Path | None, new: Path) -> dict[str, Any]:
    """Returns a scenario's plain data with file names relative to `new` instead of `old`.

    Only names of existing files and folders change; None: the working folder is the old one.
    """
    folder = (Path() if old is None else old).resolve()
    if folder == new.resolve():
        return dict(data)
    return {key: _moved(key, value, folder, new.resolve()) for key, value in data.items()}


def _moved(key: str, value: Any, old: Path, new: Path) -> Any:
    if key == "parameters":  # of nodes, which find files by themselves
        return value
    if isinstance(value, Mapping):
        return {name: _moved(name, item, old, new) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_moved(key, item, old, new) for item in value]
    if key in _KEYS and isinstance(value, str) and not Path(value).is_absolute():
        path = old / value
        return os.path.relpath(path, new) if path.exists() else value
    return value
