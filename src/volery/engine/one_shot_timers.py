"""Calls functions once, at a simulated time."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

Action = Callable[[], Any]


class OneShotTimers:
    """Actions in order of time; those of one time in the order of `add`."""

    def __init__(self, dt_ns: int) -> None:
        self._dt_ns = dt_ns
        self._heap: list[tuple[int, int, Action]] = []
        self._added = 0

    def add(self, time_ns: int, action: Action) -> None:
        """Schedules `action()` at the end of the first physics step at or after `time_ns`."""
        heapq.heappush(self._heap, (time_ns, self._added, action))
        self._added += 1

    def next_step(self) -> int | None:
        """Returns the step of the next action, None without one."""
        return -(-self._heap[0][0] // self._dt_ns) if self._heap else None

    def pop_due(self, step: int) -> Action | None:
        """Removes and returns the next action due at or before `step`, None without one."""
        if not self._heap or self._heap[0][0] > step * self._dt_ns:
            return None
        return heapq.heappop(self._heap)[2]

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return {"heap": list(self._heap), "added": self._added}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        self._heap = list(state["heap"])
        self._added = state["added"]
