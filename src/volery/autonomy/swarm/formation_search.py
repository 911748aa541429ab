"""Plans how a flock of any size and start flies into a V."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.autonomy.swarm.ares import AresPlan, AresSearch, AresSettings
from volery.autonomy.swarm.formation_fitness import fitness_cost, flock_of
from volery.autonomy.swarm.joining import Joining
from volery.core.rng import stream_key

_CORE = 7
"""Birds that ARES leads into a V; the others join."""
_TRIES = 3
"""Searches with other random numbers, until one succeeds."""
_NEXT_SEED = 1_000_003


def plan_formation(
    positions: ArrayLike,
    velocities: ArrayLike,
    seed: int = 0,
    settings: AresSettings | None = None,
) -> AresPlan:
    """Returns a plan for a flock that starts at `positions` (N, 2) with `velocities` (N, 2).

    The same arguments give the same plan. Raises `PlanError` as `formation_fitness` does.
    """
    search = FormationSearch(positions, velocities, seed, settings)
    while not search.is_done:
        search.advance()
    return search.plan()


class FormationSearch:
    """A search for a plan that advances in slices of a few milliseconds, while the flock flies.

    ARES leads the seven foremost birds into a V; the others join its arms one by one, while it
    forms. Arguments and errors are those of `plan_formation`.
    """

    def __init__(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        seed: int = 0,
        settings: AresSettings | None = None,
    ) -> None:
        self._start = start = flock_of(positions, velocities)
        self._settings = settings or AresSettings()
        self._seed, self._tries = seed, 0
        self._num_rest = max(0, start.shape[1] - _CORE)
        self._begin_try()
        self.is_done = self.plan().is_solved
        """Whether a plan is found, or none will be."""

    def _begin_try(self) -> None:
        self._seed_now = self._seed + _NEXT_SEED * self._tries
        self._core = self._foremost(self._tries)
        self._tries += 1
        core = self._start[:, self._core]
        self._search = AresSearch(core[:2].T, core[2:].T, self._seed_now, self._settings)
        self._joining: Joining | None = None

    def _foremost(self, tries: int) -> list[int]:
        """Returns the rows of the seven foremost birds: of all, then of the left, of the right.

        The arms of a V without its first bird are formations, but what is foremost of both is none.
        """
        vx, vy = self._start[2:].sum(axis=1)
        x, y = self._start[:2]
        order = np.argsort(-(vx * x + vy * y), kind="stable")
        aside = (vx * y - vy * x)[order]
        left = aside > np.median(aside)
        if tries and min(left.sum(), (~left).sum()) >= _CORE:
            order = order[left if tries == 1 else ~left]
        return sorted(order[:_CORE].tolist())

    def plan(self) -> AresPlan:
        """Returns the best plan so far; of a flock in which some have none, a plan of no steps."""
        if not self._num_rest:
            return self._search.plan()
        trajectories = None if self._joining is None else self._joining.trajectories()
        if trajectories is None:
            trajectories = self._start[None]
        cost = float(fitness_cost(np.ascontiguousarray(trajectories[-1])))
        steps = trajectories.transpose(0, 2, 1)
        return AresPlan(steps[:, :, :2], steps[:, :, 2:], cost, cost <= self._settings.solved_cost)

    def advance(self) -> None:
        """Searches for one clone of the seven, or for one of the others; nothing after the end."""
        if self.is_done:
            return
        if not self._search.is_done:
            self._search.advance()
        elif self._joining is not None and not self._joining.is_done:
            self._joining.advance()
        elif self._joining is None and self._num_rest and self._search.plan().is_solved:
            self._joining = Joining(
                self._start,
                self._core,
                self._search.plan(),
                self._settings.limits,
                stream_key(self._seed_now, "joining"),
            )
        elif self.plan().is_solved or self._tries == _TRIES:
            self.is_done = True
        else:
            self._begin_try()
