"""Rate limit of one station: a token bucket of messages and one of bytes."""

from __future__ import annotations

from volery.comms.protocol import LONGEST_BYTES
from volery.core.clock import NS_PER_S


class RateLimit:
    """Allows a steady rate and a burst above it.

    messages_s, bytes_s: steady rates. burst: messages that may arrive at once, of any size.
    """

    def __init__(self, messages_s: float, bytes_s: float, burst: int, now_ns: int) -> None:
        self._rates = (messages_s, bytes_s)
        self._capacity = (float(burst), max(bytes_s, float(burst * LONGEST_BYTES)))
        self._left = self._capacity
        self._at_ns = now_ns

    def allows(self, size: int, now_ns: int) -> bool:
        """Returns whether a message of `size` bytes may pass now, and counts it if so."""
        passed_s = max(now_ns - self._at_ns, 0) / NS_PER_S
        self._at_ns = now_ns
        messages, in_bytes = (
            min(capacity, left + rate * passed_s)
            for capacity, left, rate in zip(self._capacity, self._left, self._rates, strict=True)
        )
        allowed = messages >= 1.0 and in_bytes >= size
        self._left = (messages - 1.0, in_bytes - size) if allowed else (messages, in_bytes)
        return allowed
