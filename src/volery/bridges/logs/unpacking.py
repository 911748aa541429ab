"""Unpacks the chunks of logs, up to the largest size of a chunk.

    data = unpack("lz4", packed, size)

Each decompressor has a limit of bytes, so that a decompression bomb costs no more than a chunk.
"""

from __future__ import annotations

import bz2
from collections.abc import Callable

import lz4.frame
import zstandard

from volery.bridges.logs.budgets import MAX_CHUNK_BYTES

_PIECE_BYTES = 1 << 20

Decompress = Callable[[memoryview, int], bytes]
"""Unpacks at most a number of bytes; ignores the rest."""


def unpack(compression: str, packed: bytes | memoryview, size: int) -> bytes:
    """Returns the `size` bytes of a chunk.

    Parameters
    ----------
    compression
        `lz4`, `zstd`, `bz2`; `none` or empty for uncompressed bytes.
    packed
        Bytes in the file.
    size
        Announced size of the unpacked bytes.

    Raises
    ------
    ValueError
        The size is beyond `MAX_CHUNK_BYTES`, the compression is unknown, or the bytes are damaged:
        they unpack to another size, or to nothing.

    """
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes; at most {MAX_CHUNK_BYTES} are read")
    decompress = _DECOMPRESSORS.get(compression)
    if decompress is None:
        raise ValueError(f"compression '{compression[:20]}' cannot be read")
    try:
        data = decompress(memoryview(packed), size + 1)
    except (OSError, RuntimeError, EOFError, zstandard.ZstdError) as error:
        raise ValueError(f"the {compression} chunk is damaged: {error}") from None
    if len(data) != size:
        what = "more" if len(data) > size else f"{len(data)}"
        raise ValueError(f"the chunk unpacks to {what} bytes, not to {size}")
    return data


def _plain(packed: memoryview, max_bytes: int) -> bytes:
    return bytes(packed[:max_bytes])


def _bz2(packed: memoryview, max_bytes: int) -> bytes:
    return _stepwise(bz2.BZ2Decompressor(), packed, max_bytes)


def _lz4(packed: memoryview, max_bytes: int) -> bytes:
    return _stepwise(lz4.frame.LZ4FrameDecompressor(), packed, max_bytes)


def _stepwise(decompressor: bz2.BZ2Decompressor, packed: memoryview, max_bytes: int) -> bytes:
    """Unpacks one frame; pieces are joined once, so that memory holds only the output."""
    data = decompressor.decompress(packed, max_bytes)
    if len(data) < max_bytes and not decompressor.eof:
        pieces = [data]
        left = max_bytes - len(data)
        while left and not decompressor.eof:
            piece = decompressor.decompress(b"", min(left, _PIECE_BYTES))
            if not piece:
                break
            pieces.append(piece)
            left -= len(piece)
        data = b"".join(pieces)
    return data


def _zstd(packed: memoryview, max_bytes: int) -> bytes:
    pieces, left = [], max_bytes
    decompressor = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
    with decompressor.stream_reader(packed) as reader:
        while left and (piece := reader.read(min(left, _PIECE_BYTES))):
            pieces.append(piece)
            left -= len(piece)
    return b"".join(pieces)


_DECOMPRESSORS: dict[str, Decompress] = {
    "": _plain,
    "none": _plain,
    "lz4": _lz4,
    "zstd": _zstd,
    "bz2": _bz2,
}
