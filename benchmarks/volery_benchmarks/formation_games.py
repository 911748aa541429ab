"""Games of the search for a V against an attacker, after A. Lukina et al., "Attacking the V", 2017.

A removal game: the attacker removes birds of a V once. A displacement game: in each of 20 steps the
attacker displaces every bird, at random or, as a planner, by the worst of some random
displacements; the controller plans after each step and flies the first one of its plan. It wins if
the birds are in a V within the steps that it has after the last attack.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from volery.autonomy.swarm.formation_fitness import BEST_ASIDE, BEST_BEHIND, formation_fitness
from volery.autonomy.swarm.formation_search import plan_formation
from volery.core.arrays import Array
from volery.core.machine import usable_cores

_BIRDS = 7
_ATTACKS, _STEPS_AFTER = 20, 40
_DISPLACEMENT = 0.5
"""Largest displacement of a bird in an attack, wing spans."""
_CHOICES = 20
"""Displacements of which a planning attacker takes the worst."""

Attack = Callable[[np.random.Generator, Array, Array], Array]
"""Returns displacements (N, 2) of birds at positions (N, 2) with velocities (N, 2)."""


def play(games: int) -> dict[str, float]:
    """Returns the shares of games that the controller wins."""
    with ThreadPoolExecutor(usable_cores()) as pool:

        def fraction(game: Callable[[int], bool]) -> float:
            return sum(pool.map(game, range(games))) / games

        return {
            "games_won_one_removed": fraction(lambda seed: _removal(seed, 1)),
            "games_won_two_removed": fraction(lambda seed: _removal(seed, 2)),
            "games_won_random_displacement": fraction(lambda seed: _displacement(seed, _at_random)),
            "games_won_planned_displacement": fraction(lambda seed: _displacement(seed, _worst)),
        }


def _removal(seed: int, removed: int) -> bool:
    rng = np.random.default_rng(seed)
    kept = np.sort(rng.choice(_BIRDS, _BIRDS - removed, replace=False))
    positions, velocities = _v()
    plan = plan_formation(positions[kept], velocities[kept], seed)
    return plan.is_solved and len(plan.positions) - 1 <= _STEPS_AFTER


def _displacement(seed: int, attack: Attack) -> bool:
    rng = np.random.default_rng(seed)
    positions, velocities = _v()
    for move in range(_ATTACKS):
        positions = positions + attack(rng, positions, velocities)
        plan = plan_formation(positions, velocities, seed * _ATTACKS + move)
        step = min(1, len(plan.positions) - 1)
        positions, velocities = plan.positions[step], plan.velocities[step]
    plan = plan_formation(positions, velocities, seed)
    return plan.is_solved and len(plan.positions) - 1 <= _STEPS_AFTER


def _v() -> tuple[Array, Array]:
    rank = np.arange(_BIRDS) - _BIRDS // 2
    positions = np.stack([BEST_ASIDE * rank, -BEST_BEHIND * np.abs(rank)], axis=1)
    return positions, np.tile([0.0, 0.7], (_BIRDS, 1))


def _at_random(rng: np.random.Generator, positions: Array, _velocities: Array) -> Array:
    size = rng.uniform(0.0, _DISPLACEMENT, len(positions))
    turn = rng.uniform(-np.pi, np.pi, len(positions))
    moved: Array = (size * np.array([np.cos(turn), np.sin(turn)])).T
    return moved


def _worst(rng: np.random.Generator, positions: Array, velocities: Array) -> Array:
    choices = [_at_random(rng, positions, velocities) for _ in range(_CHOICES)]
    return max(choices, key=lambda moved: formation_fitness(positions + moved, velocities).cost)
