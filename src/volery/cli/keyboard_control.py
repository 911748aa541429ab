"""Maps keys to commands for a flight: pause, single steps, speed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from volery.runtime.facets.clock import RunClock

MIN_SPEED, MAX_SPEED = 2.0**-10, 2.0**16


def steer(clock: RunClock, key: str, real_time_factor: float) -> None:
    """Executes the command of `key`; ignores other keys.

    real_time_factor: the measured factor of the run, from which the first - starts at full speed.
    """
    if key == " ":
        (clock.resume if clock.paused else clock.pause)()
    elif key in ".s":
        (clock.single_step if clock.paused else clock.pause)()
    elif key in "+=":
        if clock.speed is not None:
            clock.set_speed(min(clock.speed * 2.0, MAX_SPEED))
    elif key == "-":
        speed = _power_of_two(real_time_factor) if clock.speed is None else clock.speed
        clock.set_speed(max(speed / 2.0, MIN_SPEED))
    elif key == "m":
        clock.set_speed(None)


def _power_of_two(factor: float) -> float:
    """Returns the nearest power of two within the limits."""
    factor = min(max(factor, MIN_SPEED), MAX_SPEED)
    return 2.0 ** round(math.log2(factor))
