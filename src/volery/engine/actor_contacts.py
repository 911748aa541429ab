"""Detects contacts between UAVs and actors.

As in `collisions`, the gap is shared: a UAV may use half of it, by its budget, before the next
check, and an actor the other half, for which its maximum speed gives a time. When a UAV is within
the bounding sphere of an actor, which may turn on the spot, the next check is at most 10 ms away.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.world.actors import MovingActors
from volery.world.scene import Scene, Solid
from volery.world.scene_content import BodyShape

_MIN_GAP_M = 1e-3
"""In contact, check again after each millimetre."""
_RELEASE_M = 0.02
"""Gap beyond which a contact has ended, so that another contact is a new event."""
_NEAR_LOOK_NS = 10_000_000
_LONGEST_WAIT_S = 1000.0
_MAX_LOOK_M = 10.0
"""More than the size of any UAV."""

Touch = Callable[[int, int, Array, bool, int], None]
"""Receives UAV, actor, (3,) m from the actor's nearest point to the UAV, is new, time ns."""


class ActorShapes:
    """The actors of a world, with distance queries to their shapes, in their own frames."""

    def __init__(self, actors: MovingActors) -> None:
        self.actors = actors
        self._max_distance_m = [2.0 * shape.radius + _MAX_LOOK_M for shape in actors.shapes]
        by_shape: dict[int, Scene] = {}
        for shape in actors.shapes:
            if id(shape) not in by_shape:
                by_shape[id(shape)] = _alone(shape)
        self._scenes = [by_shape[id(shape)] for shape in actors.shapes]

    def from_position(self, k: int, pose: Array, position: Array) -> tuple[Array, float]:
        """Returns vector (3,) m and distance m from actor `k` at `pose` (7,) to a position (3,).

        Inside, the distance is negative, and the vector points to the nearest surface.
        """
        point = rotations.rotate(rotations.conjugate(pose[3:]), position - pose[:3])
        found = self._scenes[k].clearance(
            point[None], self._max_distance_m[k], include_terrain=False
        )
        distance = float(found.distance[0])
        away = (point - found.nearest[0]) * (-1.0 if distance < 0.0 else 1.0)
        return rotations.rotate(pose[3:], away), distance


def _alone(shape: BodyShape) -> Scene:
    solids = [Solid(mesh, material, "") for mesh, material in shape.parts]
    return Scene(None, None, solids=solids)


class ActorContacts:
    """Checks UAVs against actors at the necessary times, and calls `touch` for contacts."""

    def __init__(self, fleet: Fleet, looks: ActorShapes, touch: Touch) -> None:
        actors = looks.actors
        self._fleet = fleet
        self._actors = actors
        self._looks = looks
        self._touch = touch
        self._radius = np.array([a.body.collision_radius_m for a in fleet.airframes])
        radii = np.array([shape.radius for shape in actors.shapes])
        self._radii_m = np.where(actors.is_flat, -np.inf, radii)
        self._touching = np.zeros((len(self._radius), len(actors)), dtype=bool)
        self._next_ns = np.zeros(len(self._radius), dtype=np.int64)
        """Time of the latest next check of each UAV, ns."""

    @property
    def next_look_ns(self) -> int:
        """Time of the next check that does not depend on the UAVs' motion, ns."""
        return int(self._next_ns.min())

    def resolve(self, refilled: NDArray[np.int64], time_ns: int) -> None:
        """Checks UAVs with a new budget, and those whose time has come.

        Lowers their budgets to the distances to the actors.
        """
        rows = np.union1d(refilled, np.flatnonzero(self._next_ns <= time_ns))
        if not len(rows):
            return
        poses, speeds = self._actors.poses_at(time_ns), self._actors.speeds_m_s
        state = self._fleet.state
        for i in rows.tolist():
            gaps, is_near = self._look_around(i, poses, time_ns)
            half = np.maximum(0.5 * gaps, 0.5 * _MIN_GAP_M)
            state.separation_budget[i] = min(state.separation_budget[i], float(half.min()))
            self._next_ns[i] = time_ns + self._wait_ns(half, speeds, is_near)

    def look_again(self) -> None:
        """Checks every UAV at once, after an actor was teleported."""
        self._next_ns[:] = 0

    def forget(self, rows: NDArray[np.int64]) -> None:
        """Resets UAVs: they are in no contact, and are checked at once."""
        self._touching[rows] = False
        self._next_ns[rows] = 0

    def continue_from(
        self, other: ActorContacts, own: NDArray[np.int64], theirs: NDArray[np.int64]
    ) -> None:
        """Copies the contacts of another fleet's UAVs: own rows and the other's."""
        self._touching[own] = other._touching[theirs]

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return {"touching": self._touching.copy(), "next_ns": self._next_ns.copy()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        self._touching[...] = state["touching"]
        self._next_ns[...] = state["next_ns"]

    def _look_around(self, i: int, poses: Array, time_ns: int) -> tuple[Array, bool]:
        """Returns lower limits of the gaps (T,) m of UAV `i` to all actors; reports contacts.

        The second value is whether the UAV is within the bounding sphere of an actor.
        """
        position, radius = self._fleet.state.position_map[i], float(self._radius[i])
        apart = np.linalg.norm(position - poses[:, :3], axis=1)
        gaps = apart - self._radii_m - radius
        near = np.flatnonzero(gaps <= 0.0).tolist()
        for k in near:
            away, distance = self._looks.from_position(k, poses[k], position)
            gaps[k] = distance - radius
            if gaps[k] <= 0.0:
                is_new = not self._touching[i, k]
                self._touching[i, k] = True
                self._touch(i, k, away, is_new, time_ns)
        self._touching[i, gaps > _RELEASE_M] = False
        return gaps, bool(near)

    def _wait_ns(self, half: Array, speeds: Array, is_near: bool) -> int:
        """Returns the time until an actor may have used its half, a whole number of steps, ns."""
        moves = speeds > 0.0
        wait_s = float((half[moves] / speeds[moves]).min(initial=np.inf))
        wait_ns = int(min(wait_s, _LONGEST_WAIT_S) * NS_PER_S)
        if is_near:
            wait_ns = min(wait_ns, _NEAR_LOOK_NS)
        dt_ns = self._fleet.dt_ns
        return max(wait_ns // dt_ns, 1) * dt_ns
