"""A few threads over kernels that run without Python's lock, with results nobody can influence.

A batch is cut into numbered pieces whose results do not depend on who computes them. Every thread,
the calling one included, runs the same kernel; inside it each takes the next free number from a
shared counter until none is left. Nothing waits in a loop.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import threading
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


class _Elsewhere:
    """Keeps the pool's threads off the calling thread's core.

    On virtual machines that hide which cores share a cache, Linux wakes a thread where its waker
    runs and moves it away only after many milliseconds: two threads then share one core while
    another idles. Threads that may run anywhere but there spread at once.
    """

    def __init__(self) -> None:
        self._allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
        self._current_core = getattr(ctypes.CDLL(None), "sched_getcpu", None)
        self._threads: list[int] = []
        self._avoided = -1

    def enter(self) -> None:
        """Take charge of the calling thread, which has just begun."""
        self._threads.append(threading.get_native_id())
        self._avoided = -1

    def arrange(self) -> None:
        """Send the threads elsewhere, where there is an elsewhere and they are not there yet."""
        if self._current_core is None or len(self._allowed) < 2:
            return
        here = self._current_core()
        if here == self._avoided:
            return
        self._avoided = here
        others = self._allowed - {here}
        for thread in self._threads:
            with contextlib.suppress(OSError):  # it has ended, or cores were taken away
                os.sched_setaffinity(thread, others)


class Workers:
    """`threads` threads: the calling one and a pool of the others."""

    def __init__(self, threads: int = 1) -> None:
        if threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        self.threads = threads
        self._elsewhere = _Elsewhere()
        self._pool = (
            ThreadPoolExecutor(
                threads - 1, thread_name_prefix="volery", initializer=self._elsewhere.enter
            )
            if threads > 1
            else None
        )

    def run(self, function: Callable[..., object], *args: object, alone: bool = False) -> None:
        """Call `function(*args)` on every thread, or with `alone` on this one; wait for all."""
        pool = None if alone else self._pool
        if pool is not None:
            self._elsewhere.arrange()
        others = [pool.submit(function, *args) for _ in range(self.threads - 1)] if pool else []
        function(*args)
        for other in others:
            if not other.cancel():  # not begun yet: there was nothing left to do
                other.result()

    def close(self) -> None:
        """End the pool's threads."""
        if self._pool is not None:
            self._pool.shutdown()
