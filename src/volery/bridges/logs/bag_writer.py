"""Writes ROS 1 bags that ROS 1 itself can read."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from lz4.frame import compress
from rosbags.rosbag1 import Writer

CHUNK_BYTES = 1 << 20


def bag_writer(path: Path, *, compressed: bool = True) -> Writer:
    """Returns the writer of a bag that does not exist yet; `open()` creates the file."""
    writer = Writer(path)
    writer.chunk_threshold = CHUNK_BYTES
    if compressed:
        writer.set_compression(Writer.CompressionFormat.LZ4)
        writer.compressor = _roslz4_frame
    return writer


def _roslz4_frame(data: bytes) -> bytes:
    """Compresses a chunk for roslz4, which reads only this kind of frames.

    Source: `lz4s.c` of ros_comm 1.15: roslz4 refuses linked blocks, a content size and checksums of
    blocks, and reads the last eight bytes as an end mark and a checksum of the content.
    """
    frame = compress(data, 0, block_linked=False, store_size=False, content_checksum=True)
    return cast("bytes", frame)
