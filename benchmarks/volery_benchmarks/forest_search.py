"""Measures the bench `forest_search`: three UAVs search the Barro Colorado forest, ten times.

Each flight takes five minutes; one UAV alone flies a tenth of the seeds again, to show the benefit
of a team, and once more where trunks are rare. `quick` flies one minute with one seed.
"""

from __future__ import annotations

import logging
import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from volery_benchmarks.forest_flight import Search, fly, search_scenario, sparse_scenario
from volery_benchmarks.registry import Measured

_LOG = logging.getLogger(__name__)
_UAVS = 3
_SEEDS, _SECONDS = range(1, 11), 300.0
_QUICK_SEEDS, _QUICK_SECONDS = range(1, 2), 60.0
_FIRST_SECONDS = 30.0
"""Time flown before any measurement, s: by then all kernels are compiled or loaded."""
_TRUNK_M = 0.5


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench."""
    seeds, seconds = (_QUICK_SEEDS, _QUICK_SECONDS) if quick else (_SEEDS, _SECONDS)
    team = []
    fly(search_scenario(_UAVS, seeds[0], _FIRST_SECONDS))
    for seed in seeds:
        team.append(fly(search_scenario(_UAVS, seed, seconds)))
        _LOG.info("seed %d: %.2f of real time", seed, team[-1].real_time_factor)
    alone = [fly(search_scenario(1, seed, seconds)) for seed in list(seeds)[:1]]
    measured = figures_of(team, alone)
    if quick:
        return measured
    sparse = figures_of_sparse(fly(sparse_scenario(seeds[0], seconds)))
    return replace(measured, figures={**measured.figures, **sparse})


def figures_of_sparse(search: Search) -> dict[str, float]:
    """Returns the figures of a flight among few trunks."""
    return {
        "sparse_ate_rmse_m": max(search.ate_rmse_m().values(), default=math.nan),
        "sparse_distance_m": min(search.distances_m().values()),
        "sparse_collisions": float(search.collisions),
    }


def figures_of(team: Sequence[Search], alone: Sequence[Search]) -> Measured:
    """Returns the figures of a team's flights, and of one UAV's with the first of their seeds."""
    errors = [error for search in team for error in search.ate_rmse_m().values()]
    distances = [distance for search in team for distance in search.distances_m().values()]
    delays = [delay for search in team for delay in search.target_delays_s()]
    errors_m = [error for search in team for error in search.target_errors_m()]
    trunks = np.concatenate([search.trunk_errors_m(aligned=True) for search in team])
    unaligned_m = np.concatenate([search.trunk_errors_m() for search in team])
    figures = {
        "realtime_factor": statistics.median(search.real_time_factor for search in team),
        "realtime_factor_worst": min(search.real_time_factor for search in team),
        "collisions": float(sum(search.collisions for search in team)),
        "distance_m_least": min(distances),
        "distance_m_median": statistics.median(distances),
        "searched_m2": statistics.median(search.searched_m2() for search in team),
        "searched_three_to_one": _three_to_one(team, alone),
        "targets_found": statistics.fmean(len(s.target_errors_m()) for s in team),
    }
    failures = {}
    if errors:
        figures["ate_rmse_m_median"] = statistics.median(errors)
        figures["ate_rmse_m_worst"] = max(errors)
    else:
        failures["ate_rmse_m_median"] = "no UAV published an estimated pose"
    if len(trunks):
        figures["trunks"] = float(len(trunks))
        figures["trunks_within_half_m"] = float((trunks <= _TRUNK_M).mean())
        figures["trunks_within_half_m_unaligned"] = float((unaligned_m <= _TRUNK_M).mean())
    else:
        failures["trunks_within_half_m"] = "no trunk was seen three times"
    if delays:
        figures["target_delay_s_worst"] = max(delays)
        figures["target_error_m_median"] = statistics.median(errors_m)
    else:
        failures["target_delay_s_worst"] = "no target was found"
    return Measured(figures, failures)


def _three_to_one(team: Sequence[Search], alone: Sequence[Search]) -> float:
    """Returns the area searched by the team over that of one UAV, same seeds and time."""
    ratios = []
    for three, one in zip(team, alone, strict=False):
        until_s = min(three.simulated_s, one.simulated_s)
        ratios.append(three.searched_m2(until_s) / one.searched_m2(until_s))
    return statistics.median(ratios)
