"""Plans the next velocity of one bird from what it hears of its flock: a V without a leader.

After DAMPC (A. Lukina et al., "Adaptive neighborhood resizing for stochastic reachability in
multi-agent systems", 2018, arXiv 1805.07929): each bird optimizes the fitness of its neighbourhood
by its own acceleration. Here the birds plan in turn, and neighbourhoods have one size. A bird that
this leaves without a position in the V flies to an end of an arm, as the further birds of a larger
flock do from the beginning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.swarm.formation_fitness import fitness_cost, upwash_of
from volery.autonomy.swarm.joining import exact_formation, free_positions, trajectory_into
from volery.autonomy.swarm.particle_swarm import (
    FlockLimits,
    accelerate,
    best_acceleration,
    margin_between,
)
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.rng import stream_key
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm

_MAX_HORIZON = 5
_PARTICLES = 10
_ENOUGH = 0.8
"""Part of the present cost at which a look-ahead is far enough."""
_PROGRESS = 0.95
"""Part of the least cost so far that counts as progress."""
_PATIENCE = 4
"""Steps without progress after which a bird without upwash looks for another position."""
_FORMED_COST = 0.3
"""Cost of the birds in formation below which the others fly to its ends."""
_SOLVED_COST = 0.02
_HAS_POSITION = 0.9
"""Upwash of a bird that has a position."""
_AHEAD = 60
"""Steps of a trajectory to an end."""
_ROUNDING = 1e-9
_SLOWEST = 0.05
"""Speed, wing spans per step, below which no bird flies: it could not accelerate again."""
_CHANGES = np.array(
    [
        size * np.array([np.cos(turn), np.sin(turn)])
        for size in (0.0, 0.25, 0.5, 0.75, 1.0)
        for turn in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ]
)
"""Changes of the velocity (C, 2) that are tried, in the largest one."""


class MemberPlanner(SavedAttributes):
    """Plans one bird, step by step.

    limits: what it keeps. neighbours: size of a neighbourhood, the bird included. seed: of its
    searches.
    """

    STATE = ("is_joining", "_waits", "_counter", "_least_cost", "_stalled_steps")

    def __init__(self, limits: FlockLimits, *, neighbours: int = 7, seed: int = 0) -> None:
        self._limits, self._neighbours = limits, neighbours
        self._key, self._counter = stream_key(seed, "member"), 0
        self.is_joining = False
        """Whether the bird is outside the formation, on the way to an end of it."""
        self._waits = False
        """Whether it has yet to see a formation that it can join."""
        self._least_cost, self._stalled_steps = np.inf, 0

    def begin(self, flock: Array, me: int) -> None:
        """Sets off in a flock (4, N): the foremost neighbourhood searches, the others join it."""
        ahead = flock[2:].sum(axis=1) @ flock[:2]
        foremost = np.argsort(-ahead, kind="stable")[: self._neighbours]
        self.is_joining = self._waits = me not in foremost
        self._forget()

    def velocity(self, flock: Array, joining: NDArray[np.bool_], me: int) -> Array:
        """Returns the bird's velocity (2,) in the step that begins.

        flock: (4, N), positions when the step begins, and velocities: those announced for it, or
        the last ones. joining: (N,), birds outside the formation. me: row of the bird. All birds
        must use one order. Lengths are wing spans, times steps.
        """
        formed = [row for row in range(flock.shape[1]) if row != me and not joining[row]]
        self._choose_role(flock, formed, me)
        if not self.is_joining:
            wanted = self._search(flock, formed, me)
        elif norm(flock[2:, formed].mean(axis=1)) < _SLOWEST:
            wanted = flock[2:, me]  # a formation at rest has no arms
        elif self._waits and fitness_cost(np.ascontiguousarray(flock[:, formed])) > _FORMED_COST:
            wanted = flock[2:, formed].mean(axis=1)
        else:
            self._waits = False
            wanted = self._join(flock, formed, joining, me)
        return self._safe(flock, me, wanted)

    # ------------------------------------------------------------------------------------- inside

    def _choose_role(self, flock: Array, formed: list[int], me: int) -> None:
        """Joins where it has no position in the formation; ends joining where it has one."""
        if not formed:
            self.is_joining = self._waits = False  # others join this bird
            return
        rows = sorted([*formed, me])
        formation = np.ascontiguousarray(flock[:, rows])
        upwash = np.array([upwash_of(formation, k) for k in range(len(rows))])
        ahead = formation[2:].mean(axis=1) @ formation[:2]
        mine = rows.index(me)
        if self.is_joining:
            if upwash[mine] > _HAS_POSITION and not self._waits:
                self.is_joining = False
                self._forget()
            return
        upwash[int(np.argmax(ahead))] = 1.0  # the first one needs none
        if (
            self._stalled_steps >= _PATIENCE
            and upwash[mine] < _HAS_POSITION
            and int(np.argmin(upwash)) == mine
        ):
            self.is_joining = True

    def _forget(self) -> None:
        self._least_cost, self._stalled_steps = np.inf, 0

    def _search(self, flock: Array, formed: list[int], me: int) -> Array:
        """Returns the velocity that serves the neighbourhood best."""
        distance = np.hypot(*(flock[:2, formed] - flock[:2, me : me + 1]))
        nearest = np.argsort(distance, kind="stable")[: self._neighbours - 1]
        rows = sorted([*(formed[k] for k in nearest), me])
        around, mine = np.ascontiguousarray(flock[:, rows]), rows.index(me)
        cost = float(fitness_cost(around))
        if cost < max(_PROGRESS * self._least_cost, _SOLVED_COST):
            self._least_cost, self._stalled_steps = min(cost, self._least_cost), 0
        else:
            self._stalled_steps += 1
        if cost < _FORMED_COST and norm(around[2:].mean(axis=1)) >= _SLOWEST:
            return self._settle(around, mine)
        least, chosen, found = np.inf, np.zeros(2), np.empty(2)
        for horizon in range(1, _MAX_HORIZON + 1):
            reached, self._counter = best_acceleration(
                around, mine, horizon, _PARTICLES, self._limits, self._key, self._counter, found
            )
            if reached < least:
                least, chosen = reached, found.copy()
            if least < _ENOUGH * cost:
                break
        moved = np.empty_like(around)
        accelerate(around, mine, chosen[0], chosen[1], 1, self._limits.max_speed, moved)
        return moved[2:, mine].copy()

    def _settle(self, around: Array, mine: int) -> Array:
        """Returns the velocity to where the bird should be in a neighbourhood that is formed."""
        position = exact_formation(around)[:, mine]
        return self._towards(around[:, mine], position, around[2:].mean(axis=1), np.empty((4, 0)))

    def _join(self, flock: Array, formed: list[int], joining: NDArray[np.bool_], me: int) -> Array:
        """Returns the velocity towards the end of an arm that is this bird's."""
        formation = np.ascontiguousarray(flock[:, formed])
        outside = sorted({me, *np.flatnonzero(joining).tolist()})
        ends, _ = free_positions(formation, flock[:, outside])
        others = [row for row in range(flock.shape[1]) if row != me]
        position, velocity = ends[outside.index(me)], formation[2:].mean(axis=1)
        return self._towards(flock[:, me], position, velocity, flock[:, others])

    def _towards(self, bird: Array, position: Array, velocity: Array, others: Array) -> Array:
        """Returns the first velocity of a trajectory to a position that moves with `velocity`.

        Past others (4, N), which fly straight. The present velocity, if there is none.
        """
        paths = others[:2] + np.arange(_AHEAD)[:, None, None] * others[2:]
        trajectory = np.empty((_AHEAD, 4))
        joined, self._counter = trajectory_into(
            bird.copy(),
            position.copy(),
            velocity,
            paths,
            self._limits,
            self._key,
            self._counter,
            trajectory,
        )
        return trajectory[1, 2:].copy() if joined >= 0 else bird[2:].copy()

    def _safe(self, flock: Array, me: int, wanted: Array) -> Array:
        """Returns the velocity nearest to `wanted` that the limits and the other birds allow.

        If none keeps the distance, the one that comes least near.
        """
        own, limits = flock[2:, me], self._limits
        largest = max(self._max_change(own), 2.0 * _SLOWEST)
        change = wanted - own if np.isfinite(wanted).all() else np.zeros(2)
        velocity = own + np.concatenate(([_shortened(change, largest)], _CHANGES * largest))
        speed = np.linalg.norm(velocity, axis=1)
        velocity *= np.minimum(1.0, limits.max_speed / np.maximum(speed, 1e-12))[:, None]
        nearest, velocity = velocity[0], velocity[speed >= _SLOWEST]
        margin = _margins(flock, me, velocity, limits.min_distance)
        if (margin < 0.0).all():
            return np.array(velocity[int(np.argmax(margin))])
        away = np.linalg.norm(velocity - nearest, axis=1)
        return np.array(velocity[int(np.argmin(np.where(margin >= 0.0, away, np.inf)))])

    def _max_change(self, own: Array) -> float:
        return min(self._limits.max_acceleration, norm(own))


def _shortened(vector: Array, length: float) -> Array:
    return vector * min(1.0, length / max(norm(vector), 1e-12))


@kernel
def _margins(flock: Any, me: int, velocities: Any, min_distance: float) -> Any:
    """Returns how far a bird with velocities (C, 2) stays out of a distance in a step, (C,).

    From the others of the flock (4, N); negative: too near. See `margin_between`.
    """
    margins = np.full(len(velocities), np.inf)
    for c in range(len(velocities)):
        for j in range(flock.shape[1]):
            if j == me:
                continue
            x, y = flock[0, me] - flock[0, j], flock[1, me] - flock[1, j]
            after_x = x + velocities[c, 0] - flock[2, j]
            after_y = y + velocities[c, 1] - flock[3, j]
            margin = margin_between(x, y, after_x, after_y, min_distance)
            margins[c] = min(margins[c], margin + _ROUNDING)
    return margins
