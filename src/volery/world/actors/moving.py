"""The actors of a world: names, shapes, and poses at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.world.actors.motions import ActorMotion, GivenMotion
from volery.world.scene_content import BodyShape

_VELOCITY_STEP_S = 1e-3


@dataclass(frozen=True, eq=False)
class MovingActor:
    """One actor. `kind`: its shape, such as person."""

    name: str
    kind: str
    shape: BodyShape
    motion: ActorMotion
    is_flat: bool = False
    """Whether UAVs may land on it: it lies on what is below, and has no contacts."""
    tags: tuple[str, ...] = ()
    """More about the actor, for the page and other clients."""


class MovingActors:
    """All T actors of a world, in a fixed order."""

    def __init__(self, actors: Sequence[MovingActor]) -> None:
        self._actors = tuple(actors)

    def __len__(self) -> int:
        return len(self._actors)

    @property
    def actors(self) -> tuple[MovingActor, ...]:
        """One entry per actor, in order."""
        return self._actors

    @property
    def names(self) -> tuple[str, ...]:
        """One entry per actor, in order."""
        return tuple(actor.name for actor in self._actors)

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """One entry per actor, in order."""
        return tuple(actor.shape for actor in self._actors)

    @property
    def is_flat(self) -> NDArray[np.bool_]:
        """(T,) whether UAVs may land on each actor, without a contact."""
        return np.array([actor.is_flat for actor in self._actors], np.bool_)

    @property
    def speeds_m_s(self) -> Array:
        """(T,) maximum speeds, m/s, until an external setting changes them."""
        return np.array([actor.motion.speed_m_s for actor in self._actors])

    def poses_at(self, time_ns: int) -> Array:
        """Returns the poses (T, 7) x y z (m) qx qy qz qw, map from body."""
        time_s = s_from_ns(time_ns)
        return np.array([actor.motion.pose_at(time_s) for actor in self._actors]).reshape(-1, 7)

    def velocity_at(self, row: int, time_ns: int) -> Array:
        """Returns the velocity (3,) m/s of an actor, map: mean of the millisecond from now on."""
        motion, time_s = self._actors[row].motion, s_from_ns(time_ns)
        step = motion.pose_at(time_s + _VELOCITY_STEP_S) - motion.pose_at(time_s)
        return np.asarray(step[:3] / _VELOCITY_STEP_S)

    def set_pose(
        self, row: int, time_ns: int, pose: ArrayLike, velocity: ArrayLike = (0, 0, 0)
    ) -> None:
        """Sets the `pose` (7,) of an actor from now on, and its velocity (3,) m/s, map.

        Raises `CommandError` if the actor's motion is not external.
        """
        actor = self._actors[row]
        if not isinstance(actor.motion, GivenMotion):
            raise CommandError(
                f"{actor.name} has a motion of its own; only actors with a motion of kind "
                '"external" can be moved'
            )
        actor.motion.set_pose(s_from_ns(time_ns), pose, velocity)

    def get_state(self) -> list[object]:
        """Returns the state of externally set actors; None for others."""
        return [
            actor.motion.get_state() if isinstance(actor.motion, GivenMotion) else None
            for actor in self._actors
        ]

    def set_state(self, state: Sequence[object]) -> None:
        """Restores a state of `get_state`."""
        for actor, kept in zip(self._actors, state, strict=True):
            if isinstance(actor.motion, GivenMotion):
                actor.motion.set_state(kept)
