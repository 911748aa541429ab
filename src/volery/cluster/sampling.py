"""Draws the values of parameters with a distribution: random, Latin hypercube or Sobol."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from volery.cluster.study import StudyParameter, StudySampling
from volery.core.arrays import Array
from volery.core.extras import import_extra

_INSIDE = 1e-12
"""Distance of a fraction from 0 and 1, where the normal distribution is infinite."""


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
