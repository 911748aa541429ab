"""Data files that modify another one: `base` names a shipped part or a file in the same folder.

A file can refer only to its own folder and the shipped parts, whatever its origin.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from volery.core.errors import DataFileError, reason_of
from volery.core.near_names import near_miss
from volery.core.toml_text import parse_toml
from volery.scenario.merging import merged

_KEY = "base"
_TEXTS = ("title", "source")
"""Keys of a part's description; if present, its `name` is an identifier."""
_MAX_FILES = 10
"""Maximum length of a chain of bases."""
_MAX_SHOWN = 60
"""Maximum length of a base's name in an error."""


@dataclass(frozen=True)
class FileData:
    """Content of a data file with its bases."""

    data: dict[str, Any]
    """Data of the file, merged over that of its bases; without the key `base`."""
    files: tuple[Path, ...]
    """The file, its base, the base's base, and so on."""

    @property
    def where(self) -> str:
        """File names for errors."""
        path, *bases = self.files
        shown = ", ".join(f"'{base.name}'" for base in bases)
        return f"{path} (base {shown})" if bases else str(path)


def read_toml(path: Path) -> dict[str, Any]:
    """Returns the tables of a TOML file; raises `DataFileError` naming the file."""
    try:
        return parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"{path}: cannot be read: {reason_of(error)}") from None
    except tomllib.TOMLDecodeError as error:
        raise DataFileError(f"{path}: not valid TOML: {error}") from None


def read_with_bases(path: Path, shipped: Path) -> FileData:
    """Reads a data file and its bases; parts of `shipped` may be named without `.toml`.

    A file with a base has its own name; if the file gives none, the name says that it is changed.
    Raises `DataFileError`, naming the file, if a base does not exist or the chain is circular.
    """
    files, contents = [path], [read_toml(path)]
    while _KEY in contents[-1]:
        base = _path_of_base(files[-1], contents[-1].pop(_KEY), shipped)
        if base.resolve() in [file.resolve() for file in files]:
            chain = " -> ".join(file.name for file in (*files, base))
            raise DataFileError(f"{files[-1]}: key '{_KEY}': the bases form a circle: {chain}")
        if len(files) == _MAX_FILES:
            raise DataFileError(f"{path}: key '{_KEY}': at most {_MAX_FILES} files in a chain")
        files.append(base)
        contents.append(read_toml(base))
    data = contents.pop()
    for file, changes in zip(files[-2::-1], reversed(contents), strict=True):
        data = merged(data, _with_names(changes, data, file))
    return FileData(data, tuple(files))


def _path_of_base(path: Path, name: Any, shipped: Path) -> Path:
    """Returns the path of the base that the file `path` names."""
    fault = f"{path}: key '{_KEY}':"
    known = sorted(file.stem for file in shipped.glob("*.toml"))
    allowed = f"{', '.join(known)}, or a .toml file in the same folder"
    if not isinstance(name, str):
        raise DataFileError(f"{fault} a name is needed: {allowed}")
    if name in known:
        return shipped / f"{name}.toml"
    shown = name if len(name) <= _MAX_SHOWN else f"{name[:_MAX_SHOWN]}..."
    if not name.endswith(".toml"):
        hint = near_miss(name, known)
        raise DataFileError(f"{fault} no shipped '{shown}'{hint} Allowed: {allowed}")
    if Path(name).name != name:
        raise DataFileError(f"{fault} '{shown}' lies in another folder. Allowed: {allowed}")
    base = path.parent / name
    if not _is_file_in(base, path.parent):
        raise DataFileError(f"{fault} there is no file '{shown}' in {path.parent}")
    return base


def _is_file_in(path: Path, folder: Path) -> bool:
    """Returns whether a path is a file in the folder itself, not a link to elsewhere."""
    try:
        return path.is_file() and path.resolve().parent == folder.resolve()
    except (OSError, RuntimeError, ValueError):  # too long, a circle of links, or no path at all
        return False


def _with_names(changes: dict[str, Any], data: dict[str, Any], file: Path) -> dict[str, Any]:
    """Returns the changes with a name of their own, unless the file defines one."""
    origin = f"changed in {file.name}"
    texts = [key for key in _TEXTS if key in data]
    if not texts:
        return {"name": f"{data.get('name', '')}, {origin}", **changes}
    own = {key: f"{data[key]}, {origin}" for key in texts}
    return {"name": re.sub("[^a-z0-9_]", "_", file.stem.lower()), **own, **changes}
