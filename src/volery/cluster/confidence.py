"""Means with confidence intervals: Student's for numbers, Wilson's for fractions of 0 and 1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from volery.core.extras import import_extra


@dataclass(frozen=True)
class MeanEstimate:
    """The mean of a metric with its confidence interval."""

    count: int
    """Number of values."""
    mean: float
    """Mean; nan without values."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""

    @property
    def half_width(self) -> float:
        """Half of the interval's width; inf if it is unknown."""
        width = (self.high - self.low) / 2.0
        return width if math.isfinite(width) else math.inf


def estimate_mean(values: Sequence[float], confidence: float = 0.95) -> MeanEstimate:
    """Returns the mean of finite values with its confidence interval.

    Values that are all 0 or 1 have Wilson's interval (E. B. Wilson, 1927), others Student's. Raises
    `VoleryError` if scipy is missing.
    """
    numbers = np.asarray(values, np.float64)
    numbers = numbers[np.isfinite(numbers)]
    count = len(numbers)
    if not count:
        return MeanEstimate(0, math.nan, math.nan, math.nan)
    mean = float(numbers.mean())
    if bool(np.isin(numbers, (0.0, 1.0)).all()):
        return MeanEstimate(count, mean, *_wilson(mean, count, confidence))
    if count < 2:
        return MeanEstimate(count, mean, -math.inf, math.inf)
    half = _student(count - 1, confidence) * float(numbers.std(ddof=1)) / math.sqrt(count)
    return MeanEstimate(count, mean, mean - half, mean + half)


def _wilson(mean: float, count: int, confidence: float) -> tuple[float, float]:
    from statistics import NormalDist

    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    middle = (mean + z * z / (2.0 * count)) / (1.0 + z * z / count)
    root = math.sqrt(mean * (1.0 - mean) / count + z * z / (4.0 * count * count))
    half = z * root / (1.0 + z * z / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def _student(freedom: int, confidence: float) -> float:
    """Returns the two-sided quantile of Student's distribution."""
    special = import_extra("a confidence interval", "scipy.special", "scipy", "sweep")
    return float(special.stdtrit(freedom, 0.5 + confidence / 2.0))
