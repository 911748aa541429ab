"""Plans how a flock of any start flies into a V: adaptive receding-horizon synthesis (ARES).

A. Lukina et al., TACAS 2017, doi 10.1007/978-3-662-54580-5_17. Clones of the flock search in
parallel, level by level: each looks ahead as few steps as are needed to lower the best cost by its
share, with more particles where no horizon is long enough. Then the better half of the clones
replaces the other (importance splitting).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from volery.autonomy.swarm.formation_fitness import fitness_cost, flock_of
from volery.autonomy.swarm.particle_swarm import FlockLimits, accelerate, best_accelerations
from volery.core.arrays import Array
from volery.core.rng import stream_key, uniform


class AresSettings(NamedTuple):
    """Effort of the search; the defaults are for about seven birds (docs/swarms.md)."""

    num_clones: int = 30
    num_levels: int = 20
    """Number of levels after which the search ends."""
    max_horizon: int = 5
    """Maximum steps of a look-ahead."""
    num_particles: int = 10
    more_particles: int = 2
    max_particles: int = 30
    """Particles of a bird's search, how many are added where it fails, and at most."""
    solved_cost: float = 1e-3
    """Cost at which a formation counts as a V."""
    limits: FlockLimits = FlockLimits()


class AresPlan(NamedTuple):
    """A flight from the start, step by step."""

    positions: Array
    """(T + 1, N, 2), wing spans; the first is the start."""
    velocities: Array
    """(T + 1, N, 2), wing spans per step; velocity t leads to position t."""
    cost: float
    """Cost at the end."""
    is_solved: bool
    """Whether the end is a V."""


class AresSearch:
    """A search for a plan that advances in slices of a few milliseconds, while the flock flies.

    positions, velocities: (N, 2) of the flock, in wing spans and wing spans per step. The same
    arguments give the same plan. Raises `PlanError` as `formation_fitness` does.
    """

    def __init__(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        seed: int = 0,
        settings: AresSettings | None = None,
    ) -> None:
        self._settings = chosen = settings or AresSettings()
        start = flock_of(positions, velocities)
        self._key, self._counter = stream_key(seed, "ares"), 0
        self._flights = [[start] for _ in range(chosen.num_clones)]
        """Flocks (4, N) of each clone, step by step."""
        self._found: list[tuple[float, Array]] = []
        """Cost and accelerations (2, N) of the clones that have searched on this level."""
        self._cost = float(fitness_cost(start))
        self._level, self._horizon, self._particles = 0, 1, chosen.num_particles
        self.is_done = self._cost <= chosen.solved_cost
        """Whether a plan is found, or none will be."""

    def plan(self) -> AresPlan:
        """Returns the best plan so far."""
        steps = np.stack(self._flights[0]).transpose(0, 2, 1)
        is_solved = self._cost <= self._settings.solved_cost
        return AresPlan(steps[:, :, :2], steps[:, :, 2:], self._cost, is_solved)

    def advance(self) -> None:
        """Searches for one clone; does nothing after the end."""
        if self.is_done:
            return
        flock, best = self._flights[len(self._found)][-1], np.empty((2, self._size))
        cost, self._counter = best_accelerations(
            flock,
            self._horizon,
            self._particles,
            self._settings.limits,
            self._key,
            self._counter,
            best,
        )
        self._found.append((cost, best))
        if len(self._found) == len(self._flights):
            self._end_round()

    @property
    def _size(self) -> int:
        return int(self._flights[0][0].shape[1])

    def _end_round(self) -> None:
        """Enters the next level, or makes the next round on this one look farther."""
        chosen, found = self._settings, self._found
        self._found = []
        lowest = min(cost for cost, _ in found)
        cost_step = self._cost / (chosen.num_levels - self._level)
        if lowest > max(self._cost - cost_step, chosen.solved_cost):
            self._look_farther()
            return
        ends = [
            [*flight, *self._flown(flight[-1], best)]
            for flight, (_, best) in zip(self._flights, found, strict=True)
        ]
        order = np.argsort([cost for cost, _ in found], kind="stable")
        kept = order[: max(1, len(order) // 2)]
        drawn = [kept[self._draw(len(kept))] for _ in range(len(order) - len(kept))]
        self._flights = [ends[k] for k in (*kept, *drawn)]
        self._cost, self._level = lowest, self._level + 1
        self._horizon, self._particles = 1, chosen.num_particles
        self.is_done = lowest <= chosen.solved_cost or self._level == chosen.num_levels

    def _flown(self, flock: Array, accelerations: Array) -> list[Array]:
        """Returns the flocks (4, N) after each step of the look-ahead."""
        flocks = [np.empty_like(flock) for _ in range(self._horizon)]
        max_speed = self._settings.limits.max_speed
        for step, moved in enumerate(flocks, start=1):
            for i, (size, direction) in enumerate(accelerations.T.tolist()):
                accelerate(flock, i, size, direction, step, max_speed, moved)
        return flocks

    def _look_farther(self) -> None:
        self._horizon += 1
        if self._horizon > self._settings.max_horizon:
            self.is_done = self._particles >= self._settings.max_particles
            self._horizon, self._particles = 1, self._particles + self._settings.more_particles

    def _draw(self, count: int) -> int:
        self._counter += 1
        return int(uniform(self._key, self._counter - 1) * count)
