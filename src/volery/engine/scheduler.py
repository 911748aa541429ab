"""Schedules sensors and timers on one integer clock."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from volery.core.clock import Schedule

What = TypeVar("What")


@dataclass(slots=True)
class _Entry(Generic[What]):
    order: int
    k: int
    schedule: Schedule
    lag_ns: int
    what: What
    wanted: Callable[[], bool] | None


class DueTask(NamedTuple, Generic[What]):
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
        self._heap: list[tuple[int, int, _Entry[What]]] = []
        """Entries with the step at which they are due and their order."""
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
        entry = _Entry(self._added, first, schedule, lag_ns, what, wanted)
        while self._step_at(entry, entry.k) <= after_step:
            entry.k += 1
        self._added += 1
        heapq.heappush(self._heap, self._due(entry))

    def remove(self, what: What) -> None:
        """Removes `what`; restoring an earlier state does not add it again."""
        self._heap = [item for item in self._heap if item[2].what != what]
        heapq.heapify(self._heap)

    def next_step(self) -> int | None:
        """Returns the step of the next firing, None without one."""
        if not self._heap:
            return None
        step, _, first = self._heap[0]
        if first.wanted is None or first.wanted():
            return step
        return self.next_step_of(None)

    def next_step_of(self, chosen: Callable[[What], bool] | None) -> int | None:
        """Returns the step of the next firing of the chosen entries (None: all), None without."""
        nearest = None
        for step, _, entry in self._heap:
            is_nearer = nearest is None or step < nearest
            is_wanted = entry.wanted is None or entry.wanted()
            if is_nearer and is_wanted and (chosen is None or chosen(entry.what)):
                nearest = step
        return nearest

    def pop_due(self, step: int) -> list[DueTask[What]]:
        """Returns all firings due at or before `step`, in order, and schedules the next ones."""
        due: list[DueTask[What]] = []
        heap = self._heap
        while heap and heap[0][0] <= step:
            entry = heap[0][2]
            if entry.wanted is None or entry.wanted():
                due.append(DueTask(entry.what, entry.k, entry.schedule.instant_ns(entry.k)))
            entry.k += 1
            heapq.heapreplace(heap, self._due(entry))
        return due

    def next_after(self, what: What, step: int) -> tuple[int, bool]:
        """Returns the number of the next firing of `what`, or of its last firing if at `step`.

        The second value is whether `what` has fired at `step`.
        """
        entry = next(entry for _, _, entry in self._heap if entry.what is what)
        if entry.k and self._step_at(entry, entry.k - 1) == step:
            return entry.k - 1, True
        return entry.k, False

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return {"added": self._added, "k": {order: entry.k for _, order, entry in self._heap}}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state; entries added since then are dropped."""
        counts: dict[int, int] = state["k"]
        self._added = state["added"]
        entries = [entry for _, order, entry in self._heap if order in counts]
        for entry in entries:
            entry.k = counts[entry.order]
        self._heap = [self._due(entry) for entry in entries]
        heapq.heapify(self._heap)

    def _due(self, entry: _Entry[What]) -> tuple[int, int, _Entry[What]]:
        return self._step_at(entry, entry.k), entry.order, entry

    def _step_at(self, entry: _Entry[What], k: int) -> int:
        return -(-(entry.schedule.instant_ns(k) + entry.lag_ns) // self._dt_ns)


def _first_near(schedule: Schedule, time_ns: int) -> int:
    """Returns the number of a firing shortly before `time_ns`, or 0."""
    return max(0, (time_ns - schedule.phase_ns) // schedule.period_ns - 2)
