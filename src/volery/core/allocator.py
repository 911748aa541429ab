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
_TRIMMING_BYTES = 128 << 10
"""More than FASTBIN_CONSOLIDATION_THRESHOLD of glibc, and less than is mapped by itself."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h of glibc


def return_large_blocks() -> None:
    """Returns large blocks to the system when they are freed; has no effect without glibc."""
    mallopt = _function("mallopt")
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, MAPPED_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _HEAP_SPARE_BYTES)


def return_free_memory() -> None:
    """Returns free memory of the process to the system; has no effect without glibc.

    That is memory between used blocks, and the end of the heaps of the main thread and of this one.
    """
    trim, mallopt = _function("malloc_trim"), _function("mallopt")
    if trim is None or mallopt is None:
        return
    trim(0)
    # It leaves the end of a thread's heap, which glibc trims when a block of this size is freed.
    mallopt(_M_TRIM_THRESHOLD, 0)
    _libc().free(ctypes.c_void_p(_libc().malloc(ctypes.c_size_t(_TRIMMING_BYTES))))
    return_large_blocks()


def _function(name: str) -> Any:
    """Returns a function of the C library, None where it has none of this name."""
    return getattr(_libc(), name, None)


@cache
def _libc() -> ctypes.CDLL:
    library = ctypes.CDLL(None)
    library.malloc.restype = ctypes.c_void_p
    return library
