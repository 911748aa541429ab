"""Parameter points of a study: the combinations of its parameters' values.

Parameters with a distribution are drawn: at random, by Latin hypercube or by Sobol.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from volery.cluster.errors import StudyError
from volery.cluster.study import Study, StudyParameter, StudySampling
from volery.core.arrays import Array
from volery.core.extras import import_extra

Point = Mapping[str, Any]
"""Values by the names of parameters."""
_MAX_RUNS = 10_000_000
_INSIDE = 1e-12
"""Distance of a fraction from 0 and 1, where the normal distribution is infinite."""


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


def draw(parameters: Sequence[StudyParameter], sampling: StudySampling) -> Array:
    """Returns joint draws (samples, parameters) of the parameters' distributions.

    The same sampling gives the same draws. Raises `VoleryError` if scipy is missing.
    """
    fractions = np.clip(_fractions(len(parameters), sampling), _INSIDE, 1.0 - _INSIDE)
    columns = [_quantiles(p, fractions[:, k]) for k, p in enumerate(parameters)]
    return np.stack(columns, axis=1)


def _fractions(dimensions: int, sampling: StudySampling) -> Array:
    """Returns numbers (samples, dimensions) between 0 and 1."""
    random = np.random.Generator(np.random.PCG64(sampling.seed))
    if sampling.method == "random":
        return random.random((sampling.samples, dimensions))
    qmc = import_extra(f"sampling by {sampling.method}", "scipy.stats.qmc", "scipy", "sweep")
    # scipy renamed `seed` to `rng`; as the only keyword left, it is passed by whichever exists
    kind = qmc.LatinHypercube if sampling.method == "latin_hypercube" else qmc.Sobol
    try:
        engine = kind(d=dimensions, rng=random)
    except TypeError:
        engine = kind(d=dimensions, seed=random)
    return np.asarray(engine.random(sampling.samples), dtype=np.float64)


def _quantiles(parameter: StudyParameter, fractions: Array) -> Array:
    """Returns the values of a distribution at fractions (samples,)."""
    if parameter.distribution == "normal":
        from statistics import NormalDist

        normal = NormalDist(parameter.mean or 0.0, parameter.std or 1.0)
        return np.array([normal.inv_cdf(fraction) for fraction in fractions.tolist()])
    low, high = parameter.low or 0.0, parameter.high or 0.0
    if parameter.distribution == "loguniform":
        return np.exp(math.log(low) + fractions * (math.log(high) - math.log(low)))
    return low + fractions * (high - low)
