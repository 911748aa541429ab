"""Finds the files of a ROS 2 bag, in their order, and unpacks those that are compressed."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path, PurePosixPath
from typing import Any

import zstandard

from volery.bridges.logs.bag_names import bag_files_in, is_named_after, is_one_bag
from volery.bridges.logs.budgets import MAX_CHUNK_BYTES, UnpackingBudget
from volery.bridges.logs.records import file_signature
from volery.core.errors import RecordingError

_METADATA = "metadata.yaml"
_MAX_METADATA_BYTES = 4 << 20
_PIECE_BYTES = 1 << 20
_MAX_NAMES = 10
"""Files that an error lists."""


class BagFiles:
    """The MCAP or SQLite files of a bag's folder, or one such file; close it after use.

    Files that `ros2 bag record --compression-mode file` compressed by zstd are unpacked into a
    folder for temporary files, within the limits of logs. Raises `RecordingError` if there is no
    bag, or it exceeds the limits.
    """

    def __init__(self, path: Path) -> None:
        self.mcap: list[Path] = []
        """MCAP files, in order."""
        self.sqlite: list[Path] = []
        """SQLite files, in order."""
        self._problems: list[str] = []
        self._folder = ""
        self._closing: weakref.finalize[Any, Any] | None = None
        budget = UnpackingBudget(path, bag_size(path))
        files, lost, warning = _files_of(path)
        try:
            for file in files:
                self._add(file, budget)
            if lost or (warning and self.sqlite):  # MCAP files describe themselves
                self._problems.insert(0, lost or warning)
            if not self.mcap and not self.sqlite:
                raise RecordingError(self.problem)
        except BaseException:
            self.close()
            raise

    @property
    def problem(self) -> str:
        """What is missing or not read; empty for a whole bag."""
        return "; ".join(self._problems)

    def close(self) -> None:
        """Removes unpacked files."""
        if self._closing is not None:
            self._closing()

    def __enter__(self) -> BagFiles:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def _add(self, file: Path, budget: UnpackingBudget) -> None:
        try:
            kind = file_signature(file)
        except RecordingError as error:
            self._problems.append(str(error))
            return
        packed = file
        if kind == "zstd":
            file = self._unpack(packed, budget)
            if not file.stat().st_size:
                self._problems.append(f"{packed}: cut off or damaged: nothing can be unpacked")
                return
            kind = file_signature(file)
        if kind == "mcap":
            self.mcap.append(file)
        elif kind == "sqlite":
            self.sqlite.append(file)
            rest = file.with_name(f"{file.name}-wal")
            if rest.is_file() and rest.stat().st_size:
                self._problems.append(
                    f"{rest.name} holds messages that are not read; `sqlite3 {file.name} VACUUM` "
                    "in this folder moves them"
                )
        else:
            hint = (
                "" if packed is file else f"; `zstd -d {packed.name}` unpacks a log of another kind"
            )
            self._problems.append(
                f"{packed}: cannot be read as a ROS 2 bag: neither MCAP nor SQLite{hint}"
            )

    def _unpack(self, file: Path, budget: UnpackingBudget) -> Path:
        """Returns the unpacked copy of a file; one that is cut off is unpacked as far as it goes.

        Raises `RecordingError` if it unpacks to more than the limits, or cannot be written.
        """
        if self._closing is None:
            self._folder = tempfile.mkdtemp(prefix="volery-bag-")
            self._closing = weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        copy = Path(self._folder, file.name.removesuffix(file.suffix))
        decompressor = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
        try:
            with (
                file.open("rb") as packed,
                copy.open("wb") as out,
                decompressor.stream_reader(packed, read_across_frames=True) as stream,
            ):
                while piece := stream.read(_PIECE_BYTES):
                    budget.spend(len(piece))
                    out.write(piece)
        except zstandard.ZstdError as error:
            self._problems.append(f"{file.name} is damaged, the rest is not read: {error}")
        except OSError as error:
            raise RecordingError(f"{file}: cannot be unpacked: {error.strerror}") from None
        return copy


def bag_size(path: Path) -> int:
    """Returns the size of a file, or of a folder's files together, bytes."""
    files = path.iterdir() if path.is_dir() else (path,)
    return sum(file.stat().st_size for file in files if file.is_file())


def _files_of(path: Path) -> tuple[list[Path], str, str]:
    """Returns the files of a bag in order, and what a folder lacks: files, and metadata.

    A recorder that is killed leaves a folder without `metadata.yaml`, and files may be renamed.
    Raises `RecordingError` if a folder has no such files, or files of several bags.
    """
    if not path.is_dir():
        return [path], "", ""
    names, warning = _listed(path / _METADATA)
    files = [path / name for name in names]
    missing = [file.name for file in files if not file.is_file()]
    if files and not missing:
        return files, "", ""
    present = bag_files_in(path)
    if not present:
        raise RecordingError(f"{path}: the folder holds no .mcap and no .db3 file of a ROS 2 bag")
    if not is_one_bag(present):
        others, present = present, [file for file in files if file.is_file()]
        if not present:
            raise RecordingError(
                f"{path}: {warning or f'{_METADATA} names others'}, and the names of its files are "
                f"not those of one bag ({path.name}_0, {path.name}_1): {_some(others)}; name one "
                "of them"
            )
    instead = f"; read without it: {', '.join(file.name for file in present)}"
    if missing:
        lost = f"{_METADATA} names files that are missing: {', '.join(missing)}{instead}"
        return present, lost, ""
    if len(present) > 1 and not is_named_after(present, path):
        return present, f"{warning}; read as one bag: {_some(present)}", ""
    return present, "", warning + instead


def _some(files: list[Path]) -> str:
    more = f" and {len(files) - _MAX_NAMES} more" if len(files) > _MAX_NAMES else ""
    return ", ".join(file.name for file in files[:_MAX_NAMES]) + more


def _listed(file: Path) -> tuple[list[str], str]:
    """Returns the names of a bag's files in its metadata, or why there are none."""
    from ruamel.yaml import YAML

    if not file.exists():
        return [], f"{_METADATA} is missing"
    try:
        if file.stat().st_size > _MAX_METADATA_BYTES:
            raise ValueError("it is too large")
        read = YAML(typ="safe").load(file.read_text(encoding="utf-8-sig"))
        names = read["rosbag2_bagfile_information"]["relative_file_paths"]
        # older recorders wrote the folder, too; others may not name files elsewhere
        found = [PurePosixPath(str(name).replace("\\", "/")).name for name in names]
    except Exception as error:  # of the parser on any text
        reason = " ".join(str(error).split())[:100]
        return [], f"{_METADATA} cannot be read ({reason})"
    return found, "" if found else f"{_METADATA} names no file"
