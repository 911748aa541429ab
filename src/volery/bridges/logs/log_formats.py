"""Opens logs of each format for random access."""

from __future__ import annotations

from pathlib import Path

from volery.bridges.logs.bag_chunks import BagChunks
from volery.bridges.logs.chunks import ChunkedLog
from volery.bridges.logs.mcap_chunks import McapChunks
from volery.bridges.logs.records import log_format


def open_chunks(path: Path) -> ChunkedLog:
    """Opens the chunks of a log. Raises `RecordingError` if the file is missing or no log."""
    return McapChunks(path) if log_format(path) == "mcap" else BagChunks(path)
