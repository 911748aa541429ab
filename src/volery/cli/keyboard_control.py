"""Maps keys to commands for a flight: pause, single steps, speed."""

from __future__ import annotations

import math
from typing import Any

SLOWEST, FASTEST = 2.0**-10, 2.0**16


def steer(simulation: Any, key: str, real_time_factor: float) -> None:
    """Executes the command of `key`; ignores other keys.

    real_time_factor: the measured factor of the run, from which the first - starts at full speed.
    """
    if key == " ":
        (simulation.resume if simulation.paused else simulation.pause)()
    elif key in ".s":
        (simulation.single_step if simulation.paused else simulation.pause)()
    elif key in "+=":
        if simulation.speed is not None:
            simulation.set_speed(min(simulation.speed * 2.0, FASTEST))
    elif key == "-":
        speed = _power_of_two(real_time_factor) if simulation.speed is None else simulation.speed
        simulation.set_speed(max(speed / 2.0, SLOWEST))
    elif key == "m":
        simulation.set_speed(None)


def _power_of_two(factor: float) -> float:
    """Returns the nearest power of two within the limits."""
    factor = min(max(factor, SLOWEST), FASTEST)
    return 2.0 ** round(math.log2(factor))
