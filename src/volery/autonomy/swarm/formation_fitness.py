"""The fitness of a formation: how near a flock is to a V, after the birds of A. Lukina et al.

"ARES: adaptive receding-horizon synthesis of optimal plans", TACAS 2017, with the constants of the
authors' published code. Lengths are in wing spans, times in steps. A flock is in a V when all fly
alike, no view ahead is blocked, and each but the first flies in the upwash of another. The
upwash is that of birds: it measures a formation, and acts on no multirotor.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel
from volery.core.errors import PlanError

WING_SPAN = 1.0
_OVERLAP = 0.5 - math.pi / 8.0
"""Lateral overlap of wings at the best upwash."""
BEST_ASIDE, BEST_BEHIND = 2.0 * WING_SPAN - _OVERLAP, 1.0
"""Offset of the best upwash from the bird ahead, 1.893 aside and 1 behind."""
_DOWNWASH_ASIDE = WING_SPAN - _OVERLAP
"""Lateral distance below which the air of the bird ahead is a downwash."""
_CONE = math.pi / 6.0
"""Half angle of the view ahead."""
_UPWASH = 2.5
_DOWNWASH_ACROSS, _DOWNWASH_ALONG = 0.5 / 0.3, 0.5 / 0.7
"""Decay of upwash and downwash with the squared distance."""
_EDGE = 8.0 * math.sqrt(2.0)
_FAR = 6.0
"""Distance, in wing spans, beyond which the air of another is still."""


class FormationFitness(NamedTuple):
    """Parts of the fitness of a formation; a V has the cost 0."""

    velocity_matching: float
    """Sum over pairs of their relative difference of velocities, squared."""
    clear_view: float
    """Sum of the blocked parts of the views ahead, in half angles of the view."""
    upwash: float
    """Sum of the upwash benefits, at most 1 each: all but one in a V."""
    cost: float


def formation_fitness(positions: ArrayLike, velocities: ArrayLike) -> FormationFitness:
    """Returns the fitness of a flock in the plane.

    positions, velocities: (N, 2), in wing spans and wing spans per step. Raises `PlanError` for
    other shapes and for values that are not finite.
    """
    flock = flock_of(positions, velocities)
    matching, view, upwash = fitness_parts(flock)
    return FormationFitness(matching, view, upwash, fitness_cost(flock))


def flock_of(positions: ArrayLike, velocities: ArrayLike) -> Array:
    """Returns a flock (4, N): x, y, vx, vy. Raises `PlanError` as `formation_fitness` does."""
    xy, speeds = np.asarray(positions, float), np.asarray(velocities, float)
    if xy.ndim != 2 or xy.shape[1] != 2 or xy.shape != speeds.shape or not len(xy):
        raise PlanError(
            f"positions and velocities of a flock are (N, 2) each, not {xy.shape} and "
            f"{speeds.shape}"
        )
    flock: Array = np.ascontiguousarray(np.concatenate((xy.T, speeds.T)))
    if not np.isfinite(flock).all():
        raise PlanError("a flock's positions and velocities must be finite")
    return flock


@kernel
def fitness_parts(flock: Any) -> tuple[float, float, float]:
    """Returns velocity matching, clear view and upwash of a flock (4, N)."""
    count = flock.shape[1]
    matching = view = upwash = 0.0
    for i in range(count):
        benefit = 0.0
        for j in range(count):
            if j != i:
                matching += mismatch(flock, i, j) if j > i else 0.0
                blocked, air = seen_by(flock, i, j)
                view, benefit = view + blocked, benefit + air
        upwash += min(1.0, benefit)
    return matching, view, upwash


@kernel
def fitness_cost(flock: Any) -> float:
    """Returns the cost of a flock (4, N), 0 for a V."""
    matching, view, upwash = fitness_parts(flock)
    cost: float = cost_of(flock.shape[1], matching, view, upwash)
    return cost


@kernel
def upwash_of(flock: Any, i: int) -> float:
    """Returns the benefit, at most 1, that bird i of a flock (4, N) has of the others."""
    benefit = 0.0
    for j in range(flock.shape[1]):
        if j != i:
            benefit += seen_by(flock, i, j)[1]
    return min(1.0, benefit)


@inner_kernel
def cost_of(count: int, matching: float, view: float, upwash: float) -> float:
    """Returns the cost of a flock of `count` birds by the parts of its fitness."""
    missing = count - 1 - upwash
    return matching * matching + view * view + missing * missing


@inner_kernel
def mismatch(flock: Any, i: int, j: int) -> float:
    """Returns the relative difference of two birds' velocities, squared."""
    vx, vy, ux, uy = flock[2, i], flock[3, i], flock[2, j], flock[3, j]
    total = math.sqrt(vx * vx + vy * vy) + math.sqrt(ux * ux + uy * uy)
    if total <= 0.0:
        return 0.0
    dx, dy = (vx - ux) / total, (vy - uy) / total
    square: float = dx * dx + dy * dy
    return square


@inner_kernel
def seen_by(flock: Any, i: int, j: int) -> tuple[float, float]:
    """Returns which part of the view of bird i bird j blocks, and its upwash for i."""
    vx, vy = flock[2, i], flock[3, i]
    speed = math.sqrt(vx * vx + vy * vy)
    dx, dy = flock[0, j] - flock[0, i], flock[1, j] - flock[1, i]
    ahead = dx * vx + dy * vy
    if speed <= 0.0 or ahead < 0.0:
        return 0.0, 0.0
    ahead, aside = ahead / speed, abs(dx * vy - dy * vx) / speed
    if aside >= _FAR or ahead >= _FAR:
        return _blocked(aside, ahead), 0.0
    ux, uy = flock[2, j], flock[3, j]
    other = math.sqrt(ux * ux + uy * uy)
    cosine = (vx * ux + vy * uy) / (speed * other) if other > 0.0 else 0.0
    return _blocked(aside, ahead), _air(aside, ahead, cosine)


@inner_kernel
def _blocked(aside: float, ahead: float) -> float:
    """Returns which part of the view a bird blocks with its wings, in half angles of the view."""
    low = max(math.atan2(ahead, aside + WING_SPAN), 0.5 * math.pi - _CONE)
    high = min(math.atan2(ahead, aside - WING_SPAN), 0.5 * math.pi + _CONE)
    return max(0.0, high - low) / _CONE


@inner_kernel
def _air(aside: float, ahead: float, cosine: float) -> float:
    """Returns the upwash of a bird ahead, or minus its downwash."""
    smooth = math.erf(_EDGE * (aside - _DOWNWASH_ASIDE))
    if aside >= _DOWNWASH_ASIDE:
        across, along = aside - BEST_ASIDE, ahead - BEST_BEHIND
        return cosine * smooth * math.exp(-_UPWASH * (across * across + along * along))
    decay = _DOWNWASH_ACROSS * aside * aside + _DOWNWASH_ALONG * ahead * ahead
    return smooth * math.exp(-decay)
