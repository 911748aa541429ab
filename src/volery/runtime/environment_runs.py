"""Advances all environments of a vectorized simulation until flight commands are done."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from volery.core.errors import CommandError
from volery.runtime.checks import check_timeout

_CHECK_PERIOD_NS = 8_000_000
"""Period of simulated time after which a condition is checked."""


class EnvironmentRuns:
    """Waits for flight commands of single environments; all advance together.

    step: advances all environments by a number of physics steps. progress: returns the number of
    steps done and the length of a step, ns.
    """

    def __init__(
        self, step: Callable[[int], None], progress: Callable[[], tuple[int, int]]
    ) -> None:
        self._step = step
        self._progress = progress
        self._thread: int | None = None
        """Thread that steps the environments now."""

    @contextmanager
    def stepping(self) -> Iterator[None]:
        """Records that the calling thread steps the environments."""
        self._thread = threading.get_ident()
        try:
            yield
        finally:
            self._thread = None

    def is_busy(self) -> bool:
        """Returns whether another thread steps the environments now."""
        return self._thread not in (None, threading.get_ident())

    def wait(self, is_done: Callable[[], bool], timeout_s: float) -> bool:
        """Steps until `is_done()`, by `timeout_s` at most; returns whether it is."""
        check_timeout(timeout_s)
        start, dt_ns = self._progress()
        while not is_done() and (self._progress()[0] - start) * dt_ns < timeout_s * 1e9:
            self._advance()
        return is_done()

    async def wait_async(self, is_done: Callable[[], bool]) -> None:
        """Steps until `is_done()`, and lets other coroutines run in between."""
        while not is_done():
            self._advance()
            await asyncio.sleep(0)

    def _advance(self) -> None:
        """Steps to the next check, at a multiple of the period since time 0."""
        if self._thread is not None:
            raise CommandError("the environments are advancing already: use add_done_callback()")
        done, dt_ns = self._progress()
        period = max(1, _CHECK_PERIOD_NS // dt_ns)
        self._step(period - done % period)
