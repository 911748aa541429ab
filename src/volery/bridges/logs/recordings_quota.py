"""Limits the number and size of the files in a folder of recordings."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import RecordingError

MAX_RECORDINGS = 500
"""Largest number of files in the folder, including uploads."""
MAX_TOTAL_BYTES = 50_000_000_000
"""Largest size of all files."""
SUFFIXES = (".mcap", ".bag")


def room_left(folder: Path) -> int:
    """Returns the bytes that may still be written. Raises `RecordingError` above the limits."""
    files = [path for path in folder.rglob("*") if path.suffix in SUFFIXES and path.is_file()]
    left = MAX_TOTAL_BYTES - sum(path.stat().st_size for path in files)
    if len(files) >= MAX_RECORDINGS:
        raise RecordingError(f"there are {len(files)} recordings already, the maximum; remove some")
    if left <= 0:
        raise RecordingError(
            f"the recordings take {MAX_TOTAL_BYTES / 1e9:g} GB, the maximum; remove some"
        )
    return left
