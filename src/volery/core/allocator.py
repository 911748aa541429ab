"""The C library's allocator in a process that takes large messages.

glibc serves blocks from the heap that are as large as one that was freed before, up to 32 MB. Large
messages of clients then leave holes in the heap that are never returned to the system.
"""

from __future__ import annotations

import ctypes

MAPPED_BYTES = 4 << 20
"""Larger blocks are mapped from the system one by one, and returned when they are freed. Images and
scans of sensors are smaller: to map them would cost page faults at each."""
_HEAP_SPARE_BYTES = 32 << 20
"""Free memory that the heap keeps at its end."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h of glibc


def return_large_blocks() -> None:
    """Has large blocks returned to the system when they are freed; without glibc does nothing."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, MAPPED_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _HEAP_SPARE_BYTES)
