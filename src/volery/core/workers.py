"""Runs kernels on several threads without the GIL, with results independent of the threads.

A batch is divided into numbered pieces whose results do not depend on the thread. Every thread,
including the caller's, runs the same kernel, in which each takes the next free number from a shared
counter until none is left. No thread spins.
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
    """Atomically adds one to the int64 at an address; returns the value before."""

    def generate(_ctx: Any, builder: Any, _signature: Any, args: Any) -> Any:
        from llvmlite import ir

        word = ir.IntType(64)
        pointer = builder.inttoptr(args[0], word.as_pointer())
        return builder.atomic_rmw("add", pointer, ir.Constant(word, 1), "monotonic")

    return types.int64(types.intp), generate


fetch_add: Any = _fetch_add
"""`fetch_add(counter.ctypes.data)` in a kernel returns the next free number, from 0."""


def new_counter() -> NDArray[np.int64]:
    """Returns the counter of one batch, for `fetch_add`."""
    return np.zeros(1, dtype=np.int64)


class _Elsewhere:
    """Moves the pool's threads off the calling thread's core.

    On virtual machines that hide which cores share a cache, Linux wakes a thread on its waker's
    core and moves it away only after many milliseconds: two threads then share one core while
    another idles. Threads with an affinity for the other cores spread at once.
    """

    def __init__(self) -> None:
        self._allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
        self._current_core = getattr(ctypes.CDLL(None), "sched_getcpu", None)
        self._threads: list[int] = []
        self._avoided = -1

    def enter(self) -> None:
        """Registers the calling thread, which has just started."""
        self._threads.append(threading.get_native_id())
        self._avoided = -1

    def arrange(self) -> None:
        """Sets the threads' affinity to the other cores, if there are any and it has changed."""
        if self._current_core is None or len(self._allowed) < 2:
            return
        here = self._current_core()
        if here == self._avoided:
            return
        self._avoided = here
        others = self._allowed - {here}
        for thread in self._threads:
            with contextlib.suppress(OSError):  # the thread has ended, or cores were removed
                os.sched_setaffinity(thread, others)


class Workers:
    """Runs functions on `threads` threads: the caller's and a pool of the others."""

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
        """Calls `function(*args)` on every thread, or with `alone` on this one; waits for all."""
        pool = None if alone else self._pool
        if pool is not None:
            self._elsewhere.arrange()
        others = [pool.submit(function, *args) for _ in range(self.threads - 1)] if pool else []
        function(*args)
        for other in others:
            if not other.cancel():  # not started yet: no work was left
                other.result()

    def close(self) -> None:
        """Ends the pool's threads."""
        if self._pool is not None:
            self._pool.shutdown()
