"""Ranges from which scenario tests draw values of a scenario's keys."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.cluster.errors import StudyError

_RANGE = re.compile(r"(?P<key>[^=]+)=(?P<low>[^:]+):(?P<high>[^:]+)")
_UNSAFE = re.compile(r"[^a-z0-9_]+")


@dataclass(frozen=True)
class Variation:
    """A key of the scenario with the range of its values."""

    key: str
    """Path of keys, or `wind`: a speed along x, m/s."""
    low: float
    """Minimum value."""
    high: float
    """Greatest value."""
    is_whole: bool = False
    """Whether values are whole numbers."""

    @classmethod
    def of(cls, text: str) -> Variation:
        """Returns the range of `KEY=LOW:HIGH`. Raises `StudyError` for another text."""
        found = _RANGE.fullmatch(text.replace(" ", ""))
        try:
            if found is None:
                raise ValueError
            low, high = float(found["low"]), float(found["high"])
        except ValueError:
            raise StudyError(f"--vary: KEY=LOW:HIGH, such as wind=0:6, not '{text}'") from None
        if found["key"] == "seed":
            raise StudyError("--vary seed: --seeds N --first-seed M varies the seed")
        if not (math.isfinite(low) and math.isfinite(high)):
            raise StudyError(f"--vary {text}: the range must be finite")
        if not low < high:
            raise StudyError(f"--vary {text}: {low:g} must be below {high:g}")
        return cls(found["key"], low, high)

    def name(self, number: int) -> str:
        """Returns the name of a study's parameter for it, the `number`th variation."""
        word = _UNSAFE.sub("_", self.key.lower()).strip("_")
        return f"vary_{number}_{word}"[:60]

    def drawn(self, seed: int, number: int) -> float:
        """Returns the value of a seed, which depends on nothing else."""
        return float(np.random.default_rng([seed, number]).uniform(self.low, self.high))

    def value(self, drawn: float) -> Any:
        """Returns what a scenario has under the key."""
        if self.is_whole:
            return round(drawn)
        return [drawn, 0.0, 0.0] if self.key == "wind" else drawn

    def at(self, part: float) -> float:
        """Returns the value at a part of the range, 0 to 1."""
        return self.low + part * (self.high - self.low)

    def rounded(self, number: float) -> list[float]:
        """Returns a number rounded to a tenth, hundredth and thousandth of the range's size."""
        digits = 1 - math.floor(math.log10(self.high - self.low))
        found = [round(number, digits + more) for more in range(3)]
        return [each for each in found if self.low <= each <= self.high]

    def number(self, value: Any) -> float:
        """Returns the number that `value` was made of."""
        return float(value[0]) if self.key == "wind" else float(value)
