"""Schedules sensors and timers on one integer clock."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from volery.core.clock import Schedule

What = TypeVar("What")


@dataclass(order=True)
class _Entry(Generic[What]):
    due_step: int
    order: int
    k: int = field(compare=False)
    schedule: Schedule = field(compare=False)
    lag_ns: int = field(compare=False)
    what: What = field(compare=False)
    wanted: Callable[[], bool] | None = field(compare=False)


@dataclass(frozen=True)
class DueTask(Generic[What]):
    """The k-th firing of a schedule, nominally at `instant_ns`."""

    what: What
    k: int
    instant_ns: int


class Scheduler(Generic[What]):
    """Periodic entries; each fires at the first physics step at or after its instant plus lag.

    Entries due at one step fire in the order in which they were added.
    """

    def __init__(self, dt_ns: int) -> None:
        self._dt_ns = dt_ns
        self._heap: list[_Entry[What]] = []
        self._added = 0

    def add(
        self,
        what: What,
        schedule: Schedule,
        *,
        lag_ns: int = 0,
        after_step: int = -1,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Schedules `what`, with `lag_ns` of delay (a sweep must end before its result exists).

        Skips firings at or before `after_step`, and those while `wanted()` is false, for which no
        tick ends.
        """
        first = _first_near(schedule, after_step * self._dt_ns - lag_ns)
        entry = _Entry(0, self._added, first, schedule, lag_ns, what, wanted)
        entry.due_step = self._step_of(entry)
        while entry.due_step <= after_step:
            entry.k += 1
            entry.due_step = self._step_of(entry)
        self._added += 1
        heapq.heappush(self._heap, entry)

    def remove(self, what: What) -> None:
        """Removes `what`; restoring an earlier state does not add it again."""
        self._heap = [entry for entry in self._heap if entry.what != what]
        heapq.heapify(self._heap)

    def next_step(self) -> int | None:
        """Returns the step of the next firing, None without one."""
        if self._heap and ((first := self._heap[0]).wanted is None or first.wanted()):
            return first.due_step
        steps = (e.due_step for e in self._heap if e.wanted is None or e.wanted())
        return min(steps, default=None)

    def next_step_of(self, chosen: Callable[[What], bool]) -> int | None:
        """Returns the step of the next firing of the chosen entries, None without one."""
        steps = (e.due_step for e in self._heap if chosen(e.what) and (not e.wanted or e.wanted()))
        return min(steps, default=None)

    def pop_due(self, step: int) -> list[DueTask[What]]:
        """Returns all firings due at or before `step`, in order, and schedules the next ones."""
        due = []
        while self._heap and self._heap[0].due_step <= step:
            entry = self._heap[0]
            if entry.wanted is None or entry.wanted():
                due.append(DueTask(entry.what, entry.k, entry.schedule.instant_ns(entry.k)))
            entry.k += 1
            entry.due_step = self._step_of(entry)
            heapq.heapreplace(self._heap, entry)
        return due

    def next_after(self, what: What, step: int) -> tuple[int, bool]:
        """Returns the number of the next firing of `what`, or of its last firing if at `step`.

        The second value is whether `what` has fired at `step`.
        """
        entry = next(entry for entry in self._heap if entry.what is what)
        if entry.k and self._step_at(entry, entry.k - 1) == step:
            return entry.k - 1, True
        return entry.k, False

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return {"added": self._added, "k": {entry.order: entry.k for entry in self._heap}}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state; entries added since then are dropped."""
        counts: dict[int, int] = state["k"]
        self._added = state["added"]
        self._heap = [entry for entry in self._heap if entry.order in counts]
        for entry in self._heap:
            entry.k = counts[entry.order]
            entry.due_step = self._step_of(entry)
        heapq.heapify(self._heap)

    def _step_of(self, entry: _Entry[What]) -> int:
        return self._step_at(entry, entry.k)

    def _step_at(self, entry: _Entry[What], k: int) -> int:
        return -(-(entry.schedule.instant_ns(k) + entry.lag_ns) // self._dt_ns)


def _first_near(schedule: Schedule, time_ns: int) -> int:
    """Returns the number of a firing shortly before `time_ns`, or 0."""
    return max(0, (time_ns - schedule.phase_ns) // schedule.period_ns - 2)
