"""Logs events that clients can cause without end: once at first, then now and then with a count."""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

PERIOD_S = 60.0
"""Between two lines about the same event."""


class RareLog:
    """Counts events by their text; safe for any thread.

    logger: where lines go. period_s: wall time between two lines of one text.
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
        """Of each text: when it was logged last, and its count then."""
        self.counts: Counter[str] = Counter()
        """Events so far, by text."""

    def note(self, text: str) -> None:
        """Counts an event, and logs it if that is due. The texts must be few."""
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
    """Lets a message of another library pass once a period; repeats are counted, not printed.

    bare: beginnings of messages that are logged without their traceback.
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
