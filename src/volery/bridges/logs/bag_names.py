"""Names that rosbag2 gives to the files of one bag.

Each is the name of the bag's folder with the number of the file, `flight_0.mcap`. Since 2026 the
number comes first and a time last, `0_flight_2026_01_31-09_30_00.mcap`, and `flight` is the folder
without its own time (`SequentialWriter::format_storage_uri` of rosbag2_cpp).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

_SUFFIXES = (".mcap", ".db3")
_PACKED = (".zstd", ".zst")
_NUMBER = r"(?P<number>0|[1-9]\d*)"
_TIME = r"_\d{4}_\d\d_\d\d-\d\d_\d\d_\d\d"
_FORMS = (
    re.compile(rf"{_NUMBER}_(?P<bag>.+){_TIME}", re.ASCII),
    re.compile(rf"(?!.*{_TIME}$)(?P<bag>.+)_{_NUMBER}", re.ASCII),
)
_FOLDER_TIME = re.compile(rf"{_TIME}$", re.ASCII)


class _Part(NamedTuple):
    form: int
    bag: str
    suffix: str
    number: str


def bag_files_in(folder: Path) -> list[Path]:
    """Returns the files of a folder that have suffixes of bags, in the order of their numbers.

    Hidden ones are left out: macOS writes `._x_0.mcap` beside each file of an archive.
    """
    found = (
        file
        for file in folder.iterdir()
        if file.is_file() and not file.name.startswith(".") and _plain(file.name)[1]
    )
    return _in_order(found)


def is_one_bag(files: Sequence[Path]) -> bool:
    """Returns whether files are parts of one bag by their names; a single file is always one."""
    if len(files) < 2:
        return True
    parts = [_part(file.name) for file in files]
    bags = {part and part[:3] for part in parts}
    return None not in bags and len(bags) == 1 and len(set(parts)) == len(parts)


def is_named_after(files: Sequence[Path], folder: Path) -> bool:
    """Returns whether the names of a bag's files begin with the name of its folder."""
    name = folder.resolve().name
    names = (name, _FOLDER_TIME.sub("", name))
    return all((part := _part(file.name)) is not None and part.bag in names for file in files)


def _part(name: str) -> _Part | None:
    stem, suffix = _plain(name)
    for form, pattern in enumerate(_FORMS):
        if (found := pattern.fullmatch(stem)) is not None:
            return _Part(form, found["bag"], suffix, found["number"])
    return None


def _plain(name: str) -> tuple[str, str]:
    """Returns a name without its suffixes, and that of the log; empty if it has none of a bag."""
    for packed in _PACKED:
        name = name.removesuffix(packed)
    suffix = next((suffix for suffix in _SUFFIXES if name.endswith(suffix)), "")
    return name.removesuffix(suffix), suffix


def _in_order(parts: Iterable[Path]) -> list[Path]:
    """Returns paths in the order of their numbers: `x_0.db3` to `x_10.db3`."""
    return sorted(parts, key=lambda part: (len(part.name), part.name))
