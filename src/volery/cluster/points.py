"""Parameter points of a study: the combinations of its parameters' values."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from volery.cluster.errors import StudyError
from volery.cluster.sampling import draw
from volery.cluster.study import Study, StudyParameter

Point = Mapping[str, Any]
"""Values by the names of parameters."""
_MAX_RUNS = 10_000_000


def values_of(parameter: StudyParameter) -> tuple[Any, ...]:
    """Returns the values of a parameter with values or a range."""
    if parameter.range is not None and parameter.steps is not None:
        return tuple(np.linspace(*parameter.range, parameter.steps).tolist())
    return parameter.values or ()


def points_of(study: Study, where: str) -> tuple[Point, ...]:
    """Returns all parameter points of a study, in a fixed order; one empty without parameters.

    where: names the file in errors. Raises `StudyError` for more runs than a study may have, or
    if a package for the sampling is missing.
    """
    listed = {name: p for name, p in study.parameters.items() if not p.is_random}
    random = {name: p for name, p in study.parameters.items() if p.is_random}
    samples = 1 if study.sampling is None else study.sampling.samples
    count = _combinations(study, listed) * samples * len(study.all_seeds)
    if count > _MAX_RUNS:
        raise StudyError(f"{where}: {count:,} runs; a study has at most {_MAX_RUNS:,}")
    draws: list[list[float]] = [[]]
    if study.sampling is not None:
        draws = draw(list(random.values()), study.sampling).tolist()
    found = []
    for values in _listed_values(study, listed):
        for drawn in draws:
            by_name = {
                **dict(zip(listed, values, strict=True)),
                **dict(zip(random, drawn, strict=True)),
            }
            found.append({name: by_name[name] for name in study.parameters})
    return tuple(found)


def _combinations(study: Study, listed: Mapping[str, StudyParameter]) -> int:
    counts = [len(values_of(parameter)) for parameter in listed.values()]
    if study.combine == "list":
        return counts[0] if counts else 1
    return int(np.prod(counts, dtype=object)) if counts else 1


def _listed_values(study: Study, listed: Mapping[str, StudyParameter]) -> Iterator[tuple[Any, ...]]:
    values = [values_of(parameter) for parameter in listed.values()]
    if study.combine == "list" and values:
        yield from zip(*values, strict=True)
    else:
        yield from itertools.product(*values)
