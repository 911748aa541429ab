"""Measures swarms: plans that lead random flocks into a V, as ARES does, flights by them, crowds.

Starts are those of the paper (A. Lukina et al., TACAS 2017): seven birds in a box of 3 wing spans,
at least 1 apart, speeds from .25 to .75 per axis. ARES reports 95 % of 8,000 starts and 63 s.
Each part is a function that returns figures; `measure(only=...)` runs some of them.
"""

from __future__ import annotations

import logging
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from volery.autonomy.swarm.formation_search import plan_formation
from volery.core.arrays import Array
from volery.core.machine import usable_cores
from volery_benchmarks import crowds, distributed_formation, formation_games
from volery_benchmarks.formation_flight import fly
from volery_benchmarks.large_swarms import measure_real_time
from volery_benchmarks.registry import chosen_parts

_LOG = logging.getLogger(__name__)
_BIRDS = 7
_BOX, _APART = 3.0, 1.0
_SPEEDS = 0.25, 0.75
_STARTS, _QUICK_STARTS = 1000, 20
_FLIGHTS, _QUICK_FLIGHTS = 100, 2
_GAMES, _QUICK_GAMES = 100, 2
_RUNS = {"orca": 100, "trajectories": 100, "vasarhelyi": 10, "olfati_saber": 10}
"""Runs of each situation; rules of flocks, beside which ORCA flies, mostly use the whole time."""


def measure(*, quick: bool = False, only: Sequence[str] = ()) -> dict[str, float]:
    """Returns the figures of the parts named in `only`, by default of all.

    Raises `VoleryError` for an unknown part.
    """
    figures: dict[str, float] = {}
    for name in chosen_parts("swarm", PARTS, only):
        _LOG.info("%s", name)
        figures |= PARTS[name](quick)
    return figures


def _plans(quick: bool) -> dict[str, float]:
    """Returns how many random starts end in a V, and the CPU time of a plan."""
    plan_formation(*_start(0))  # compiles
    seeds = range(_QUICK_STARTS if quick else _STARTS)
    with ThreadPoolExecutor(usable_cores()) as pool:
        solved, seconds = zip(*pool.map(_plan, seeds), strict=True)
    return {
        "ares_success": sum(solved) / len(solved),
        "ares_s_mean": statistics.fmean(seconds),
        "ares_s_median": statistics.median(seconds),
        "ares_s_max": max(seconds),
    }


def _flights(quick: bool) -> dict[str, float]:
    """Returns the figures of flights of seven F450s that lose one or two of them."""
    count = _QUICK_FLIGHTS if quick else _FLIGHTS
    fly(0, _BIRDS, 1)  # compiles
    figures: dict[str, float] = {}
    for lost, word in ((1, "one"), (2, "two")):
        flights = [fly(seed, _BIRDS, lost) for seed in range(1, count + 1)]
        recoveries = [flight.recovery_s for flight in flights]
        figures |= {
            f"recovery_s_{word}_lost": float(np.nanmedian(recoveries)),
            f"recovery_success_{word}_lost": float(np.isfinite(recoveries).mean()),
        }
        if lost == 1:
            times = [flight.time_to_v_s for flight in flights]
            figures |= {
                "time_to_v_s": float(np.nanmedian(times)),
                "v_success": float(np.isfinite(times).mean()),
                "least_distance_m": min(flight.min_distance_m for flight in flights),
                "v_real_time_factor": statistics.median(f.real_time_factor for f in flights),
            }
    return figures


def _distributed(quick: bool) -> dict[str, float]:
    """Returns the figures of birds without a leader, and of flights in which one is lost."""
    seeds = range(1, 1 + (_QUICK_STARTS if quick else _STARTS))
    distributed_formation.plan(*_start(0), 0)  # compiles
    steps, seconds = zip(*(distributed_formation.plan(*_start(k), k) for k in seeds), strict=True)
    count = _QUICK_FLIGHTS if quick else _FLIGHTS
    flights = [distributed_formation.fly(seed, _BIRDS, 1) for seed in range(1, count + 1)]
    times = [flight.time_to_v_s for flight in flights]
    recoveries = [flight.recovery_s for flight in flights]
    return {
        "dampc_success": sum(step is not None for step in steps) / len(steps),
        "dampc_steps_median": float(statistics.median(step for step in steps if step is not None)),
        "dampc_s_mean": statistics.fmean(seconds),
        "dampc_time_to_v_s": float(np.nanmedian(times)),
        "dampc_v_success": float(np.isfinite(times).mean()),
        "dampc_recovery_s_one_lost": float(np.nanmedian(recoveries)),
        "dampc_recovery_success_one_lost": float(np.isfinite(recoveries).mean()),
        "dampc_least_distance_m": min(flight.min_distance_m for flight in flights),
        "dampc_real_time_factor": statistics.median(f.real_time_factor for f in flights),
    }


def _games(quick: bool) -> dict[str, float]:
    """Returns the shares of games that the search wins against an attacker."""
    return formation_games.play(_QUICK_GAMES if quick else _GAMES)


def _crowd(situation: str, quick: bool) -> dict[str, float]:
    """Returns the figures of a situation with each behaviour."""
    figures: dict[str, float] = {}
    for behaviour, runs in _RUNS.items():
        flights = crowds.fly_all(situation, behaviour, 1 if quick else runs)
        figures |= {
            f"{situation}_{behaviour}_{word}": value
            for word, value in (
                ("collisions", float(sum(flight.crashed > 0 for flight in flights))),
                ("arrived", statistics.fmean(flight.arrived for flight in flights)),
                ("s_median", statistics.median(flight.seconds for flight in flights)),
                ("least_distance_m", min(flight.min_distance_m for flight in flights)),
            )
        }
    return figures


PARTS: dict[str, Callable[[bool], dict[str, float]]] = {
    "plans": _plans,
    "flights": _flights,
    "games": _games,
    "distributed": _distributed,
    "scale": measure_real_time,
    **{situation: partial(_crowd, situation) for situation in crowds.SITUATIONS},
}
"""Functions of the parts; their argument is `quick`."""


def _plan(seed: int) -> tuple[bool, float]:
    """Returns whether a plan is found, and the CPU time of the search."""
    start = time.thread_time()
    found = plan_formation(*_start(seed), seed)
    return found.is_solved, time.thread_time() - start


def _start(seed: int) -> tuple[Array, Array]:
    """Returns positions and velocities (N, 2) of a random flock."""
    rng = np.random.default_rng(seed)
    while True:
        positions = rng.uniform(0.0, _BOX, (_BIRDS, 2))
        apart = np.linalg.norm(positions[:, None] - positions, axis=2)
        if apart[np.triu_indices(_BIRDS, 1)].min() >= _APART:
            return positions, rng.uniform(*_SPEEDS, (_BIRDS, 2))
