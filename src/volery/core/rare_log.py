"""Logs events that clients can cause endlessly: the first at once, later ones with a count."""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

PERIOD_S = 60.0
"""Minimum time between two lines about the same event."""


class RareLog:
    """Counts events by their text; thread-safe.

    logger: receives the lines. period_s: wall time between two lines of one text.
    """

    def __init__(
        self,
        logger: logging.Logger,
        period_s: float = PERIOD_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._logger = logger
        self._period_s = period_s
        self._clock = clock
        self._lock = threading.Lock()
        self._logged: dict[str, tuple[float, int]] = {}
        """Time and count of each text when it was last logged."""
        self.counts: Counter[str] = Counter()
        """Number of events so far, by text."""

    def note(self, text: str) -> None:
        """Counts an event, and logs it when due. The number of texts must be small."""
        with self._lock:
            self.counts[text] += 1
            count, now_s = self.counts[text], self._clock()
            last_s, before = self._logged.get(text, (-self._period_s, 0))
            if now_s - last_s < self._period_s:
                return
            self._logged[text] = (now_s, count)
        times = count - before
        self._logger.warning("%s%s", text, "" if times == 1 else f" ({times} times)")


class RepeatFilter(logging.Filter):
    """Passes a message of another library once per period; repeats are only counted.

    bare: prefixes of messages that are logged without their traceback.
    """

    def __init__(self, period_s: float = PERIOD_S, bare: tuple[str, ...] = ()) -> None:
        super().__init__()
        self._period_s = period_s
        self._bare = bare
        self._last_s: dict[str, float] = {}
        self._missed: Counter[str] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        """Returns whether the record is logged."""
        if record.levelno < logging.WARNING:
            return True
        text, now_s = str(record.msg), time.monotonic()
        if now_s - self._last_s.get(text, -self._period_s) < self._period_s:
            self._missed[text] += 1
            return False
        self._last_s[text] = now_s
        if text.startswith(self._bare or ("\0",)):
            record.exc_info = record.exc_text = None
        missed = self._missed.pop(text, 0)
        if missed:
            record.msg = f"{record.getMessage()} (and {missed} times before)"
            record.args = ()
        return True
