"""Estimates the send time of a message by the receiver's clock.

A frame holds its send time by its source's clock. The two clocks may differ, and messages that a
server has stored arrive late, all at once. So a message counts as new if the gap to the previous
one is about the same at both ends. A new message gives the offset of the clocks, which then gives
the age of late ones. Before, both clocks are assumed to agree.
"""

from __future__ import annotations

from volery.core.clock import NS_PER_S

_MIN_GAP_RATIO = 0.5
"""Min ratio of the gaps at both ends; a smaller one is a backlog that arrives at once, or its
beginning.
"""
_LONGEST_KEPT_NS = 65 * NS_PER_S
"""Slightly longer than a server stores messages; an older one means that the clocks differ.
Modelling choices.
"""


class ClockOffset:
    """Clock offset of one source."""

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None
        """Send time of the latest message, by its source's clock, and its arrival."""
        self._offset_ns: int | None = None
        """Own clock minus the source's; None: unknown."""

    def made_ns(self, sent_ns: int, now_ns: int) -> int:
        """Returns the send time of a message that arrives now, by the own clock, at most now."""
        if self._before is not None:
            sent_gap_ns, gap_ns = sent_ns - self._before[0], now_ns - self._before[1]
            if 0 < _MIN_GAP_RATIO * sent_gap_ns <= gap_ns <= sent_gap_ns / _MIN_GAP_RATIO:
                self._offset_ns = now_ns - sent_ns
        self._before = sent_ns, now_ns
        if self._offset_ns is not None:
            return min(sent_ns + self._offset_ns, now_ns)
        return sent_ns if 0 <= now_ns - sent_ns <= _LONGEST_KEPT_NS else now_ns
