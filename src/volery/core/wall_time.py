"""Provides wall time that does not jump when the machine's clock is set."""

from __future__ import annotations

import time

_ZERO_NS = time.time_ns() - time.monotonic_ns()
"""UNIX time of the monotonic clock's zero, as the wall clock had it at the start, ns."""


def steady_time_ns() -> int:
    """Returns UNIX time, ns, by the wall clock at the start and the time elapsed since."""
    return _ZERO_NS + time.monotonic_ns()
