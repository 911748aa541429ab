"""File names in scenarios, adapted when a scenario moves to another folder."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_KEYS = (
    "airframe",
    "code_folder",
    "field",
    "file",
    "identified_model",
    "message_packages",
    "model",
)
"""Keys that name files, or parts that are shipped or in files."""


def moved(data: Mapping[str, Any], old: Path | None, new: Path) -> dict[str, Any]:
    """Returns a scenario's plain data with file names relative to `new` instead of `old`.

    Only names of existing files and folders change; None: the working folder is the old one.
    """
    folder = (Path() if old is None else old).resolve()
    if folder == new.resolve():
        return dict(data)
    return {key: _moved(key, value, folder, new.resolve()) for key, value in data.items()}


def texts_of(data: Any) -> Iterator[str]:
    """Yields all texts in plain data, file names among them."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, Mapping):
        for value in data.values():
            yield from texts_of(value)
    elif isinstance(data, list | tuple):
        for value in data:
            yield from texts_of(value)


def named_files(data: Mapping[str, Any], folder: Path | None) -> Iterator[Path]:
    """Yields the existing files that a scenario's plain data name, shipped ones excluded.

    folder: base folder of relative names; None: the working folder.
    """
    base = Path() if folder is None else folder
    for key, value in data.items():
        if key != "parameters":  # of nodes, which find files by themselves
            yield from _named(key, value, base)


def _named(key: str, value: Any, base: Path) -> Iterator[Path]:
    if isinstance(value, Mapping):
        yield from named_files(value, base)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _named(key, item, base)
    elif key in _KEYS and isinstance(value, str):
        for path in (base / value, Path(value)):
            if path.is_file():
                yield path
                return


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
