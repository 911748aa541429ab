"""Configures the C library's allocator of a process that receives large messages.

glibc serves blocks from the heap that are as large as one that was freed before, up to 32 MB. Large
messages of clients then leave holes in the heap that are never returned to the system.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

MAPPED_BYTES = 4 << 20
"""Blocks of this size or more are mapped from the system one by one, and returned when they are
freed. Images and scans of sensors are smaller: mapping each would cost page faults."""
_HEAP_SPARE_BYTES = 32 << 20
"""Free memory that remains at the end of the heap."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h of glibc


def return_large_blocks() -> None:
    """Returns large blocks to the system when they are freed; has no effect without glibc."""
    mallopt = _function("mallopt")
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, MAPPED_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _HEAP_SPARE_BYTES)


def return_free_memory() -> None:
    """Returns free memory between used blocks to the system; has no effect without glibc."""
    trim = _function("malloc_trim")
    if trim is not None:
        trim(0)


@cache
def _function(name: str) -> Any:
    """Returns a function of the C library, None where it has none of this name."""
    return getattr(ctypes.CDLL(None), name, None)
