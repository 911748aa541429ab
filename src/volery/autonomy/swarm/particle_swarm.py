"""Particle swarm optimisation of the accelerations of a flock, bird by bird.

J. Kennedy, R. Eberhart, 1995. ARES searches the accelerations of all birds at once; here each bird
in turn searches its own, with those of the others as they are, until no round helps any more. A
search of two numbers needs few particles, and a trial costs one bird's part of the fitness.
Deterministic: the random numbers come from a counter.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.swarm.formation_fitness import cost_of, fitness_cost, mismatch, seen_by
from volery.core.compiled import inner_kernel, kernel, owning_kernel
from volery.core.rng import uniform

_SELF, _SOCIAL, _INERTIA = 1.49, 1.49, 0.6
_FIRST_SPEED = 0.25
"""Speed of particles at first, as a part of their range."""
_TURN = 2.0 * math.pi
_ITERATIONS = 10
"""Moves of a bird's particles."""
_MAX_ROUNDS = 3
"""Maximum searches of each bird."""
_PROGRESS = 1e-3
"""Decrease of the cost in a round, relative to it, below which the search ends."""


class FlockLimits(NamedTuple):
    """Limits of birds in flight; none by default, as in the paper."""

    min_distance: float = 0.0
    """Two birds never come nearer, wing spans; those that start nearer do not approach."""
    max_speed: float = math.inf
    """Wing spans per step."""
    max_acceleration: float = math.inf
    """Maximum change of a velocity in a step, wing spans per step; at most a bird's speed."""


def vehicle_limits(
    min_distance: float,
    max_speed_m_s: float,
    max_acceleration_m_s2: float,
    wing_span_m: float,
    step_s: float,
) -> FlockLimits:
    """Returns the limits of birds whose steps vehicles can follow; min_distance in wing spans."""
    return FlockLimits(
        min_distance,
        max_speed_m_s * step_s / wing_span_m,
        max_acceleration_m_s2 * step_s**2 / wing_span_m,
    )


class _Flock(NamedTuple):
    """A flock of N birds after a look-ahead, and what each means to each other one."""

    moved: Any
    """(4, N): x, y, vx, vy."""
    mismatch: Any
    """(N, N): difference of two velocities, 0 on the diagonal."""
    blocked: Any
    """(N, N): part of the view of i that j blocks."""
    air: Any
    """(N, N): upwash of j for i."""


class _Swarm(NamedTuple):
    """The particles that search for a bird; each is an acceleration: size, direction in rad."""

    position: Any
    """(P, 2)"""
    velocity: Any
    """(P, 2)"""
    own: Any
    """(P, 2): the best position of each."""
    cost: Any
    """(P,): cost there."""


@kernel
def best_accelerations(
    start: Any,
    horizon: int,
    num_particles: int,
    limits: FlockLimits,
    key: np.uint64,
    counter: int,
    best: Any,
) -> tuple[float, int]:
    """Searches the accelerations after which the flock is nearest to a V.

    Each bird accelerates once, by at most its own speed, and flies on.

    Parameters
    ----------
    start
        (4, N): x, y, vx, vy.
    horizon
        Steps after which the formation counts.
    num_particles
        Size of the swarm that searches for a bird.
    limits
        What the flock keeps; where none is found that does, the cost is infinite.
    key, counter
        Stream of random numbers, and the number of the next one.
    best
        (2, N): receives sizes and directions (rad) of the accelerations.

    Returns
    -------
    cost, counter
        Cost after the horizon, and the number of the next random number.

    """
    count = start.shape[1]
    best[:] = 0.0
    flock, swarm = _flown_straight(start, horizon, limits), _new_swarm(num_particles)
    order, benefit = np.arange(count), np.empty(count)
    cost = math.inf
    for _ in range(_MAX_ROUNDS):
        before = cost
        counter = _shuffle(order, key, counter)
        for i in order:
            cost, counter = _search(
                start, i, horizon, limits, flock, swarm, benefit, key, counter, best
            )
        if before - cost <= _PROGRESS * cost:
            break
    min_distance = limits.min_distance
    is_near = min_distance > 0.0 and approach_margin(start, flock.moved, min_distance) < 0.0
    return math.inf if is_near else fitness_cost(flock.moved), counter


@kernel
def best_acceleration(
    start: Any,
    i: int,
    horizon: int,
    num_particles: int,
    limits: FlockLimits,
    key: np.uint64,
    counter: int,
    best: Any,
) -> tuple[float, int]:
    """Searches the acceleration of bird i alone, while the others fly straight.

    best: (2,), receives size and direction (rad). The other arguments and results are those of
    `best_accelerations`; the cost is infinite where each acceleration comes too near to another.
    """
    count = start.shape[1]
    flock, swarm = _flown_straight(start, horizon, limits), _new_swarm(num_particles)
    found = np.zeros((2, count))
    cost, counter = _search(
        start, i, horizon, limits, flock, swarm, np.empty(count), key, counter, found
    )
    best[0], best[1] = found[0, i], found[1, i]
    return cost, counter


@owning_kernel
def _flown_straight(start: Any, horizon: int, limits: FlockLimits) -> _Flock:
    """Returns the flock after a look-ahead in which all birds fly straight."""
    count = start.shape[1]
    square = count, count
    flock = _Flock(np.empty((4, count)), np.zeros(square), np.zeros(square), np.zeros(square))
    for i in range(count):
        accelerate(start, i, 0.0, 0.0, horizon, limits.max_speed, flock.moved)
    for i in range(count):
        _compare(flock, i)
    return flock


@owning_kernel
def _new_swarm(size: int) -> _Swarm:
    return _Swarm(np.empty((size, 2)), np.empty((size, 2)), np.empty((size, 2)), np.empty(size))


@inner_kernel
def _shuffle(order: Any, key: np.uint64, counter: int) -> int:
    """Puts the birds in a random order; returns the next counter."""
    for k in range(len(order) - 1, 0, -1):
        other = int(uniform(key, counter) * (k + 1))
        order[k], order[other] = order[other], order[k]
        counter += 1
    return counter


@inner_kernel
def _search(
    start: Any,
    i: int,
    horizon: int,
    limits: FlockLimits,
    flock: _Flock,
    swarm: _Swarm,
    benefit: Any,
    key: np.uint64,
    counter: int,
    best: Any,
) -> tuple[float, int]:
    """Searches the acceleration of bird i; returns the flock's cost and the next counter."""
    matching, view = _of_others(flock, i, benefit)
    limit = min(math.hypot(start[2, i], start[3, i]), limits.max_acceleration)
    counter = _scatter(swarm, best[0, i], best[1, i], limit, key, counter)
    leader = 0
    for iteration in range(_ITERATIONS):
        for k in range(len(swarm.cost)):
            if iteration:
                counter = _move(swarm, k, leader, limit, key, counter)
            size, direction = swarm.position[k, 0], swarm.position[k, 1]
            accelerate(start, i, size, direction, horizon, limits.max_speed, flock.moved)
            if limits.min_distance > 0.0 and _is_near(start, flock.moved, i, limits.min_distance):
                continue
            cost = _cost_with(flock.moved, i, matching, view, benefit)
            if cost < swarm.cost[k]:
                swarm.cost[k], swarm.own[k, 0], swarm.own[k, 1] = cost, size, direction
                leader = k if cost < swarm.cost[leader] else leader
    size, direction = swarm.own[leader, 0], swarm.own[leader, 1]
    best[0, i], best[1, i] = size, direction
    accelerate(start, i, size, direction, horizon, limits.max_speed, flock.moved)
    _compare(flock, i)
    return swarm.cost[leader], counter


@inner_kernel
def _scatter(
    swarm: _Swarm, size: float, direction: float, limit: float, key: np.uint64, counter: int
) -> int:
    """Places the first particle at the present acceleration, the others at random."""
    for k in range(len(swarm.cost)):
        swarm.position[k, 0] = limit * uniform(key, counter)
        swarm.position[k, 1] = _TURN * uniform(key, counter + 1)
        swarm.velocity[k, 0] = _FIRST_SPEED * limit * (2.0 * uniform(key, counter + 2) - 1.0)
        swarm.velocity[k, 1] = _FIRST_SPEED * _TURN * (2.0 * uniform(key, counter + 3) - 1.0)
        swarm.cost[k] = math.inf
        counter += 4
    swarm.position[0, 0], swarm.position[0, 1] = size, direction
    swarm.velocity[0, 0] = swarm.velocity[0, 1] = 0.0
    for k in range(len(swarm.cost)):  # until a position is allowed
        swarm.own[k, 0], swarm.own[k, 1] = swarm.position[k, 0], swarm.position[k, 1]
    return counter


@inner_kernel
def _move(swarm: _Swarm, k: int, leader: int, limit: float, key: np.uint64, counter: int) -> int:
    """Moves a particle towards its own best position and the leader's; returns the counter."""
    for q in range(2):
        position = swarm.position[k, q]
        velocity = (
            _INERTIA * swarm.velocity[k, q]
            + _SELF * uniform(key, counter) * (swarm.own[k, q] - position)
            + _SOCIAL * uniform(key, counter + 1) * (swarm.own[leader, q] - position)
        )
        counter += 2
        moved = position + velocity
        inside = min(max(moved, 0.0), limit) if q == 0 else moved
        swarm.velocity[k, q] = velocity if inside == moved else 0.0
        swarm.position[k, q] = inside
    return counter


@inner_kernel
def _of_others(flock: _Flock, i: int, benefit: Any) -> tuple[float, float]:
    """Returns velocity matching and view of the flock without bird i; fills their upwash (N,)."""
    matching = view = 0.0
    count = len(benefit)
    for a in range(count):
        benefit[a] = 0.0
        if a == i:
            continue
        for b in range(count):
            if b not in (a, i):
                matching += 0.5 * flock.mismatch[a, b]
                view += flock.blocked[a, b]
                benefit[a] += flock.air[a, b]
    return matching, view


@inner_kernel
def _cost_with(moved: Any, i: int, matching: float, view: float, benefit: Any) -> float:
    """Returns the cost of the flock with bird i as `moved` says."""
    upwash = own = 0.0
    for j in range(len(benefit)):
        if j == i:
            continue
        matching += mismatch(moved, i, j)
        blocked, air = seen_by(moved, i, j)
        view, own = view + blocked, own + air
        blocked, air = seen_by(moved, j, i)
        view, upwash = view + blocked, upwash + min(1.0, benefit[j] + air)
    return cost_of(len(benefit), matching, view, upwash + min(1.0, own))


@inner_kernel
def _compare(flock: _Flock, i: int) -> None:
    """Renews what bird i means to the others, and they to it."""
    for j in range(flock.moved.shape[1]):
        if j != i:
            flock.mismatch[i, j] = flock.mismatch[j, i] = mismatch(flock.moved, i, j)
            flock.blocked[i, j], flock.air[i, j] = seen_by(flock.moved, i, j)
            flock.blocked[j, i], flock.air[j, i] = seen_by(flock.moved, j, i)


@kernel
def accelerate(
    start: Any,
    i: int,
    size: float,
    direction: float,
    steps: int,
    max_speed: float,
    moved: Any,
) -> None:
    """Accelerates bird i once and flies it on; `moved` (4, N) receives it."""
    vx, vy = start[2, i] + size * math.cos(direction), start[3, i] + size * math.sin(direction)
    speed = math.hypot(vx, vy)
    if speed > max_speed:
        vx, vy = vx * max_speed / speed, vy * max_speed / speed
    moved[2, i], moved[3, i] = vx, vy
    moved[0, i], moved[1, i] = start[0, i] + steps * vx, start[1, i] + steps * vy


@inner_kernel
def _is_near(before: Any, after: Any, i: int, min_distance: float) -> bool:
    """Returns whether bird i comes too near to another one; see `approach_margin`."""
    for j in range(before.shape[1]):
        if j != i and _margin(before, after, i, j, min_distance) < 0.0:
            return True
    return False


@kernel
def approach_margin(before: Any, after: Any, min_distance: float) -> float:
    """Returns how far the birds stay out of `min_distance` on straight paths; negative: too near.

    Two birds that are nearer at the start must only not approach.
    """
    margin = math.inf
    for i in range(before.shape[1]):
        for j in range(i):
            margin = min(margin, _margin(before, after, i, j, min_distance))
    return margin


@inner_kernel
def _margin(before: Any, after: Any, i: int, j: int, min_distance: float) -> float:
    px, py = before[0, i] - before[0, j], before[1, i] - before[1, j]
    return margin_between(
        px, py, after[0, i] - after[0, j], after[1, i] - after[1, j], min_distance
    )


@inner_kernel
def margin_between(px: float, py: float, qx: float, qy: float, min_distance: float) -> float:
    """Returns `approach_margin` of two birds whose offset changes from (px, py) to (qx, qy)."""
    qx, qy = qx - px, qy - py
    square = qx * qx + qy * qy
    t = min(max(-(px * qx + py * qy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    nearest = math.hypot(px + t * qx, py + t * qy)
    return nearest - min(min_distance, math.hypot(px, py))
