"""Arrays of a study's table for the report: metrics, and parameters as numbers or categories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.cluster.summary import value_text
from volery.cluster.table import StudyTable
from volery.core.arrays import Array

_MAX_LEVELS = 24
"""Distinct values up to which the runs of each value are drawn together."""
_MIN_RANKED = 3


@dataclass(frozen=True)
class ParameterAxis:
    """A parameter of a study for drawings, N runs."""

    name: str
    """Name of the parameter."""
    numbers: Array
    """(N,) values, or numbers of the levels if they are not numbers."""
    levels: tuple[Any, ...]
    """Distinct values in order; empty: there are too many, drawn as continuous."""
    is_numeric: bool
    """Whether values are numbers."""

    @property
    def labels(self) -> list[str]:
        """Texts of the levels."""
        return [value_text(level) for level in self.levels]

    def level_of(self) -> NDArray[np.int64]:
        """Returns the number of each run's level (N,)."""
        if not self.is_numeric:
            return self.numbers.astype(np.int64)
        return np.searchsorted(np.array(self.levels, np.float64), self.numbers)


def parameter_axis(table: StudyTable, name: str) -> ParameterAxis:
    """Returns a parameter for drawings."""
    values = table[name]
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        numbers = np.array(values, np.float64)
        distinct = tuple(np.unique(numbers).tolist())
        return ParameterAxis(name, numbers, distinct if len(distinct) <= _MAX_LEVELS else (), True)
    levels = tuple(dict.fromkeys(values))
    index_of_level = {level: k for k, level in enumerate(levels)}
    numbers = np.array([index_of_level[value] for value in values], np.float64)
    return ParameterAxis(name, numbers, levels, False)


def metric_values(table: StudyTable, metric: str) -> Array:
    """Returns the values (N,) of a metric; nan for failed runs."""
    column = table[metric]
    return np.array([np.nan if value is None else value for value in column], np.float64)


def is_fraction(values: Array) -> bool:
    """Returns whether all finite values are 0 or 1."""
    finite = values[np.isfinite(values)]
    return bool(len(finite)) and bool(np.isin(finite, (0.0, 1.0)).all())


def varies(values: Array) -> bool:
    """Returns whether there are two different finite values."""
    finite = values[np.isfinite(values)]
    return bool(len(finite)) and bool(finite.min() < finite.max())


def rank_correlation(one: Array, other: Array) -> float:
    """Returns Spearman's rank correlation of two arrays (N,); nan if one does not vary."""
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < _MIN_RANKED or not (varies(one[both]) and varies(other[both])):
        return np.nan
    return float(np.corrcoef(_ranks(one[both]), _ranks(other[both]))[0, 1])


def _ranks(values: Array) -> Array:
    """Returns mean ranks (N,) of equal values."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    ranks: Array = (ends - (counts - 1) / 2.0)[inverse]
    return ranks
