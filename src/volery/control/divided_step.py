"""Divides the steps of a large fleet over threads, with the bytes of one thread.

Between two guidance ticks UAVs do not affect each other, so threads advance parts of the fleet to
the tick, or by one step where something may happen to a UAV before. Events are put together in
the order of the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.workers import Workers

_MIN_ROWS = 64
"""UAVs of a part."""
_PARTS_A_THREAD = 3
"""A thread whose core does other work as well takes fewer parts."""
_WORTH = 2000
"""Steps of UAVs that take longer than to wake a thread."""
_TICK = 3
"""Steps that take as long as what a guidance tick adds to one."""


class StepPart(NamedTuple):
    """Describes some UAVs and steps for `fused_step.advance_fleet`."""

    step: int
    steps: int
    first: int
    last: int
    events: NDArray[np.void]
    calm: bool = False
    look: bool = True


class StepResult(NamedTuple):
    """Returned by `fused_step.advance_fleet`."""

    steps: int
    written: int
    spent: bool
    calm: bool
    look: bool


def is_worth_dividing(workers: Workers, count: int) -> bool:
    """Returns whether threads save time in a fleet of `count` UAVs."""
    return workers.threads > 1 and count >= 4 * _MIN_ROWS


def advance_in_parts(
    advance: Callable[[StepPart], StepResult],
    whole: StepPart,
    periods: tuple[int, int, int],
    workers: Workers,
) -> StepResult:
    """Advances all UAVs of `whole` like one call of `advance`, and returns the same.

    periods: steps between updates of guidance, attitude control and the air. The call may end
    after more events than one call would, but not before.
    """
    guidance_steps, _, air_steps = periods
    count = whole.last
    size = max(_MIN_ROWS, -(-count // (_PARTS_A_THREAD * workers.threads)))
    firsts = range(0, count, size)
    done = written = 0
    calm, look, spent = whole.calm, whole.look, False
    num_events = len(whole.events) // len(firsts)
    while done < whole.steps and not spent and not written:
        step = whole.step + done
        to_tick = guidance_steps - step % guidance_steps
        is_tick = to_tick == guidance_steps
        together = min(to_tick, whole.steps - done) if calm and not is_tick else 1
        if step % air_steps == 0 and look:
            advance(StepPart(step, 1, 0, 0, whole.events, calm, look=True))
            look = False
        if (together + _TICK * is_tick) * count < _WORTH:
            parts = [StepPart(step, together, 0, count, whole.events, calm, look=False)]
            results = [advance(parts[0])]
        else:
            parts = [
                StepPart(
                    step,
                    together,
                    first,
                    min(first + size, count),
                    whole.events[k * num_events : (k + 1) * num_events],
                    calm,
                    look=False,
                )
                for k, first in enumerate(firsts)
            ]
            results = _on_all_threads(advance, parts, workers)
        done += together
        calm = all(result.calm for result in results)
        look = look or any(result.look for result in results)
        spent = any(result.spent for result in results)
        for part, result in zip(parts, results, strict=True):
            whole.events[written : written + result.written] = part.events[: result.written]
            written += result.written
    return StepResult(done, written, spent, calm, look)


def _on_all_threads(
    advance: Callable[[StepPart], StepResult], parts: list[StepPart], workers: Workers
) -> list[StepResult]:
    """Returns the results of all parts, each of which the next free thread takes."""
    results: list[StepResult] = [StepResult(0, 0, False, False, False)] * len(parts)
    numbers = iter(range(len(parts)))  # its `next` is atomic

    def work() -> None:
        for k in numbers:
            results[k] = advance(parts[k])

    workers.run(work)
    return results
