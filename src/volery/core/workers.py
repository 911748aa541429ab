"""A few threads over kernels that run without Python's lock, with results nobody can influence.

A batch is cut into numbered pieces whose results do not depend on who computes them. Every thread,
the calling one included, runs the same kernel; inside it each takes the next free number from a
shared counter until none is left. Nothing waits in a loop.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray


@intrinsic
def _fetch_add(_context: Any, _address: Any) -> Any:
    """Add one to the int64 at that address, all threads agreeing on the order; the value before."""

    def generate(_ctx: Any, builder: Any, _signature: Any, args: Any) -> Any:
        from llvmlite import ir

        word = ir.IntType(64)
        pointer = builder.inttoptr(args[0], word.as_pointer())
        return builder.atomic_rmw("add", pointer, ir.Constant(word, 1), "monotonic")

    return types.int64(types.intp), generate


fetch_add: Any = _fetch_add
"""`fetch_add(counter.ctypes.data)` inside a kernel: the next free number, counted from 0."""


def new_counter() -> NDArray[np.int64]:
    """Counter of one batch, for `fetch_add`."""
    return np.zeros(1, dtype=np.int64)


class Workers:
    """`threads` threads: the calling one and a pool of the others."""

    def __init__(self, threads: int = 1) -> None:
        if threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        self.threads = threads
        self._pool = (
            ThreadPoolExecutor(threads - 1, thread_name_prefix="volery") if threads > 1 else None
        )

    def run(self, function: Callable[..., object], *args: object, alone: bool = False) -> None:
        """Call `function(*args)` on every thread, or with `alone` on this one; wait for all."""
        pool = None if alone else self._pool
        others = [pool.submit(function, *args) for _ in range(self.threads - 1)] if pool else []
        function(*args)
        for other in others:
            if not other.cancel():  # not begun yet: there was nothing left to do
                other.result()

    def close(self) -> None:
        """End the pool's threads."""
        if self._pool is not None:
            self._pool.shutdown()
