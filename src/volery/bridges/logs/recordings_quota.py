"""How much room is left in a folder for recordings: its files are limited in number and bytes."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import RecordingError

MAX_RECORDINGS = 500
"""Files in the folder, uploaded ones included."""
MAX_TOTAL_BYTES = 50_000_000_000
"""Of all of them."""
SUFFIXES = (".mcap", ".bag")


def room_left(folder: Path) -> int:
    """Bytes that may still be written. `RecordingError` where there are too many files or bytes."""
    files = [path for path in folder.rglob("*") if path.suffix in SUFFIXES and path.is_file()]
    left = MAX_TOTAL_BYTES - sum(path.stat().st_size for path in files)
    if len(files) >= MAX_RECORDINGS:
        raise RecordingError(
            f"there are {len(files)} recordings already, the most that are kept; remove some"
        )
    if left <= 0:
        raise RecordingError(
            f"the recordings take {MAX_TOTAL_BYTES / 1e9:g} GB, the most that are kept; remove some"
        )
    return left
