"""Plans the trajectories on which further birds join a formation that a plan has formed.

A V grows at the ends of its arms: two positions that nothing but the last bird of each arm decides.
So each bird needs only a trajectory to a position that moves with the formation. It flies there as
fast as it may accelerate and brake, past all birds whose trajectories are known; where the direct
path comes too near to one of them, it first flies to a random point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.swarm.ares import AresPlan
from volery.autonomy.swarm.formation_fitness import BEST_ASIDE, BEST_BEHIND
from volery.autonomy.swarm.particle_swarm import FlockLimits, margin_between
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import uniform
from volery.core.vectors import norm

_MAX_STEPS = 100
"""Steps after the plan of the formation in which all birds must have joined."""
_TRIALS = 100
"""Trajectories that are tried for a bird."""
_DODGES = 30
"""Accelerations that are tried in a step."""
_MAX_REPEATS = 20
"""Rounds in which a bird found no trajectory, until the search ends."""
_DETOUR = 8.0
"""Largest distance of a random point from its position in the formation, wing spans."""
_MAX_DETOUR = 10
"""Maximum steps in which it flies to that point."""
_TURN = 2.0 * math.pi
_ARRIVED = 1e-9
_LEFT = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Turns a vector (2,) to the left."""


class Joining:
    """Plans the trajectories of the birds that join a formation, one after the other.

    start: (4, N) of all birds. members: rows of those in formation, which fly as `plan` says.
    key: of the random numbers.
    """

    def __init__(
        self,
        start: Array,
        members: Sequence[int],
        plan: AresPlan,
        limits: FlockLimits,
        key: np.uint64,
    ) -> None:
        self._limits, self._key, self._counter = limits, key, 0
        self._formed = tuple(members)
        self._trajectories = np.empty((len(plan.positions) + _MAX_STEPS, 4, start.shape[1]))
        self._trajectories[0] = start
        self._formed_steps = self._settle(plan)
        formation = self._trajectories[self._formed_steps][:, self._formed]
        self._velocity = formation[2:].mean(axis=1)
        rest = [row for row in range(start.shape[1]) if row not in set(members)]
        ends, ranks = free_positions(formation, start[:, rest])
        ends -= self._formed_steps * self._velocity
        self._positions = dict(zip(rest, ends, strict=True))
        """Positions in the formation, as if it had been formed at step 0."""
        self._repeats = 0
        self._begin([rest[k] for k in np.argsort(-ranks, kind="stable")])  # those outside first

    def _begin(self, order: Sequence[int]) -> None:
        self._order, self._joined = tuple(order), 0
        self._steps = self._formed_steps
        """Steps until all birds with a trajectory are in formation."""

    @property
    def is_done(self) -> bool:
        """Whether all birds have a trajectory, or one has none."""
        return self._joined == len(self._order) or self._repeats > _MAX_REPEATS

    def trajectories(self) -> Array | None:
        """Returns all birds (T + 1, 4, N) at each step; None while one has no way."""
        return self._trajectories[: self._steps + 1] if self._joined == len(self._order) else None

    def advance(self) -> None:
        """Plans the next bird's trajectory. One that finds none is the first of another round."""
        row, before = self._order[self._joined], self._order[: self._joined]
        others = np.ascontiguousarray(self._trajectories[:, :2, [*self._formed, *before]])
        trajectory, joined = self._trajectory(row, 0, self._positions[row], self._velocity, others)
        if joined < 0:
            self._repeats += 1
            self._begin([row, *(other for other in self._order if other != row)])
            return
        self._trajectories[:, :, row] = trajectory
        self._joined += 1
        self._steps = max(self._steps, joined)

    def _settle(self, plan: AresPlan) -> int:
        """Fills the trajectories of the birds in formation; returns the steps until it is exact.

        A plan ends near a V. What is missing would add up along the arms.
        """
        end = len(plan.positions) - 1
        flown = np.concatenate((plan.positions, plan.velocities), axis=2).transpose(0, 2, 1)
        velocity = flown[-1, 2:].mean(axis=1)
        self._trajectories[: end + 1, :, self._formed] = flown
        alone = np.empty((len(self._trajectories) - end, 2, 0))
        last = end
        for row, position in zip(self._formed, exact_formation(flown[-1]).T, strict=True):
            trajectory, steps = self._trajectory(row, end, position, velocity, alone)
            self._trajectories[end:, :, row] = trajectory
            last = max(last, end + steps)
        return last

    def _trajectory(
        self, row: int, begin: int, position: Array, velocity: Array, others: Array
    ) -> tuple[Array, int]:
        """Returns a bird's trajectory (S, 4) from a step on, and when it joins.

        See `trajectory_into`.
        """
        trajectory = np.empty((len(others), 4))
        start = self._trajectories[begin][:, row].copy()
        steps, self._counter = trajectory_into(
            start, position, velocity, others, self._limits, self._key, self._counter, trajectory
        )
        return trajectory, steps


def exact_formation(flock: Array) -> Array:
    """Returns the positions (2, N) of a formation (4, N) whose birds are where they should be.

    Those on one side of the foremost bird form an arm.
    """
    ahead = flock[2:].mean(axis=1)
    ahead = ahead / norm(ahead)
    left = _LEFT @ ahead
    leader = int(np.argmax(ahead @ flock[:2]))
    order = np.argsort(left @ flock[:2], kind="stable")
    ranks = np.empty(flock.shape[1])
    ranks[order] = np.arange(len(order))
    ranks -= ranks[leader]
    offsets = np.outer(left, BEST_ASIDE * ranks) - np.outer(ahead, BEST_BEHIND * np.abs(ranks))
    exact: Array = offsets - (offsets - flock[:2]).mean(axis=1)[:, None]
    return np.ascontiguousarray(exact)


def free_positions(flock: Array, start: Array) -> tuple[Array, NDArray[np.int64]]:
    """Returns positions (M, 2) at the ends of a formation's arms, and how far out each is (M,).

    flock: (4, N) in formation, where all fly alike. start: (4, M) of the birds that join. Those on
    the left go to the left arm, the outermost farthest, so that their paths hardly cross. Both arms
    get equally long where that is possible.
    """
    ahead = flock[2:].mean(axis=1)
    ahead = ahead / norm(ahead)
    left = _LEFT @ ahead
    aside = left @ flock[:2]
    ends = flock[:2, int(np.argmax(aside))], flock[:2, int(np.argmin(aside))]
    leader = flock[:2, int(np.argmax(ahead @ flock[:2]))]
    rows = [round(abs(float(left @ (end - leader))) / BEST_ASIDE) for end in ends]
    count = start.shape[1]
    num_left = min(max((count + rows[1] - rows[0]) // 2, 0), count)
    order = np.argsort(-(left @ start[:2]), kind="stable")
    positions, ranks = np.empty((count, 2)), np.empty(count, np.int64)
    for rank, row in enumerate(order):
        is_left = rank < num_left
        out = num_left - rank if is_left else rank - num_left + 1
        step = BEST_ASIDE * (left if is_left else -left) - BEST_BEHIND * ahead
        positions[row] = ends[0 if is_left else 1] + out * step
        ranks[row] = out
    return positions, ranks


@kernel
def trajectory_into(
    start: Any,
    position: Any,
    velocity: Any,
    others: Any,
    limits: FlockLimits,
    key: np.uint64,
    counter: int,
    trajectory: Any,
) -> tuple[int, int]:
    """Searches a trajectory of a bird to a position in a formation that flies straight.

    Parameters
    ----------
    start
        (4,): x, y, vx, vy of the bird at step 0.
    position, velocity
        (2,): the position at step 0, and the formation's velocity.
    others
        (S, 2, N): positions of the birds to keep away from, at each step.
    limits
        What the bird keeps.
    key, counter
        Stream of random numbers, and the number of the next one.
    trajectory
        (S, 4): receives the bird at each step.

    Returns
    -------
    steps, counter
        Steps until the bird has joined, -1 if no trajectory was found, and the next number.

    """
    for trial in range(_TRIALS):
        turn, far = _TURN * uniform(key, counter), _DETOUR * math.sqrt(uniform(key, counter + 1))
        detour = 0 if trial == 0 else int(_MAX_DETOUR * uniform(key, counter + 2))
        x, y = far * math.cos(turn), far * math.sin(turn)
        joined, counter = _fly(
            start, position, velocity, others, limits, detour, x, y, key, counter + 3, trajectory
        )
        if joined >= 0:
            return joined, counter
    return -1, counter


@inner_kernel
def _fly(
    start: Any,
    position: Any,
    velocity: Any,
    others: Any,
    limits: FlockLimits,
    detour: int,
    x: float,
    y: float,
    key: np.uint64,
    counter: int,
    trajectory: Any,
) -> tuple[int, int]:
    """Flies to the position, for the steps of a detour to (x, y) beside it.

    Returns the step of the arrival, -1 where the bird comes too near to another one or does not
    arrive, and the next counter.
    """
    for k in range(4):
        trajectory[0, k] = start[k]
    arrived = -1
    for step in range(1, len(trajectory)):
        before, after = trajectory[step - 1], trajectory[step]
        offset_x = position[0] + (step - 1) * velocity[0] - before[0]
        offset_y = position[1] + (step - 1) * velocity[1] - before[1]
        if step <= detour:
            offset_x, offset_y = offset_x + x, offset_y + y
        ax, ay = _approach(before, offset_x, offset_y, velocity, limits)
        _accelerate(before, ax, ay, limits, after)
        dodges = 0
        while _is_too_near(trajectory, others, step, limits.min_distance):
            if dodges == _DODGES:
                return -1, counter
            dodges += 1
            turn, size = _TURN * uniform(key, counter), uniform(key, counter + 1)
            size *= dodges / _DODGES * math.hypot(before[2], before[3]) * 2.0
            counter += 2
            _accelerate(
                before, ax + size * math.cos(turn), ay + size * math.sin(turn), limits, after
            )
        gap = math.hypot(after[2] - velocity[0], after[3] - velocity[1])
        if arrived < 0 and step > detour and math.hypot(offset_x, offset_y) + gap < _ARRIVED:
            arrived = step
    return arrived, counter


@inner_kernel
def _approach(
    bird: Any, offset_x: float, offset_y: float, velocity: Any, limits: FlockLimits
) -> tuple[float, float]:
    """Returns the acceleration towards a position at an offset that moves with `velocity`."""
    distance = math.hypot(offset_x, offset_y)
    limit = limits.max_acceleration
    speed = distance
    if distance > limit:  # what it can brake within the distance
        speed = 0.5 * (math.sqrt(limit * limit + 8.0 * limit * distance) - limit)
    part = speed / distance if distance > 0.0 else 0.0
    return (
        velocity[0] + part * offset_x - bird[2],
        velocity[1] + part * offset_y - bird[3],
    )


@inner_kernel
def _accelerate(bird: Any, ax: float, ay: float, limits: FlockLimits, moved: Any) -> None:
    """Fills `moved` (4,): the bird after a step with an acceleration, within its limits."""
    size = math.hypot(ax, ay)
    allowed = min(limits.max_acceleration, math.hypot(bird[2], bird[3]))
    if size > allowed:
        ax, ay = ax * allowed / size, ay * allowed / size
    vx, vy = bird[2] + ax, bird[3] + ay
    speed = math.hypot(vx, vy)
    if speed > limits.max_speed:
        vx, vy = vx * limits.max_speed / speed, vy * limits.max_speed / speed
    moved[0], moved[1], moved[2], moved[3] = bird[0] + vx, bird[1] + vy, vx, vy


@inner_kernel
def _is_too_near(trajectory: Any, others: Any, step: int, min_distance: float) -> bool:
    """Returns whether the bird comes too near to another one in a step."""
    if min_distance <= 0.0:
        return False
    for j in range(others.shape[2]):
        px, py = (
            trajectory[step - 1, 0] - others[step - 1, 0, j],
            trajectory[step - 1, 1] - others[step - 1, 1, j],
        )
        qx, qy = trajectory[step, 0] - others[step, 0, j], trajectory[step, 1] - others[step, 1, j]
        if margin_between(px, py, qx, qy, min_distance) < 0.0:
            return True
    return False
