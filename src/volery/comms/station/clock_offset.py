"""When a message was made, by the clock of who receives it.

A frame tells when it was sent, by its source's clock. The two clocks need not agree, and what a
server has kept comes late, all at once. So a message counts as new where it came about as long
after the one before it as it was sent after that one: it tells how the clocks lie to each other,
and from then on the age of what comes late. Before, both clocks are taken for the same.
"""

from __future__ import annotations

from volery.core.clock import NS_PER_S

_PACE = 0.5
"""Gap of arrivals over that of sending times, or the other way round: less is a backlog that comes
at once, or its beginning."""
_LONGEST_KEPT_NS = 65 * NS_PER_S
"""Older than a server keeps messages, and a little: then the clocks differ. Modelling choices."""


class ClockOffset:
    """Of the messages of one source."""

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None
        """When the latest message was sent, by its source, and when it came."""
        self._offset_ns: int | None = None
        """Own clock less that of the source; None: not known."""

    def made_ns(self, sent_ns: int, now_ns: int) -> int:
        """When a message that comes now was made, by the own clock; never later than now."""
        if self._before is not None:
            sent_gap_ns, gap_ns = sent_ns - self._before[0], now_ns - self._before[1]
            if 0 < _PACE * sent_gap_ns <= gap_ns <= sent_gap_ns / _PACE:
                self._offset_ns = now_ns - sent_ns
        self._before = sent_ns, now_ns
        if self._offset_ns is not None:
            return min(sent_ns + self._offset_ns, now_ns)
        return sent_ns if 0 <= now_ns - sent_ns <= _LONGEST_KEPT_NS else now_ns
