"""The things of a world: names, shapes, and where all of them are at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.world.actors.motions import ActorMotion, GivenMotion
from volery.world.scene_content import BodyShape

Array = NDArray[np.float64]

_VELOCITY_STEP_S = 1e-3


@dataclass(frozen=True, eq=False)
class MovingActor:
    """One of them. `kind`: what it is, such as person."""

    name: str
    kind: str
    shape: BodyShape
    motion: ActorMotion


class MovingActors:
    """All things of a world, in a fixed order."""

    def __init__(self, things: Sequence[MovingActor]) -> None:
        self._things = tuple(things)

    def __len__(self) -> int:
        return len(self._things)

    @property
    def things(self) -> tuple[MovingActor, ...]:
        """In order."""
        return self._things

    @property
    def names(self) -> tuple[str, ...]:
        """In order."""
        return tuple(thing.name for thing in self._things)

    @property
    def shapes(self) -> tuple[BodyShape, ...]:
        """In order."""
        return tuple(thing.shape for thing in self._things)

    @property
    def speeds_m_s(self) -> Array:
        """(T,) none moves faster until something else is said of it."""
        return np.array([thing.motion.speed_m_s for thing in self._things])

    def poses_at(self, time_ns: int) -> Array:
        """(T, 7) x y z qx qy qz qw, map from body."""
        time_s = s_from_ns(time_ns)
        return np.array([thing.motion.pose_at(time_s) for thing in self._things]).reshape(-1, 7)

    def velocity_at(self, row: int, time_ns: int) -> Array:
        """(3,) m/s of one, map: that of the millisecond that begins now."""
        motion, time_s = self._things[row].motion, s_from_ns(time_ns)
        step = motion.pose_at(time_s + _VELOCITY_STEP_S) - motion.pose_at(time_s)
        return np.asarray(step[:3] / _VELOCITY_STEP_S)

    def say(self, row: int, time_ns: int, pose: ArrayLike, velocity: ArrayLike = (0, 0, 0)) -> None:
        """Put one at `pose` (7,) from now on, moving on at `velocity` (3,) m/s.

        `CommandError` for one that has a way of its own.
        """
        thing = self._things[row]
        if not isinstance(thing.motion, GivenMotion):
            raise CommandError(
                f"{thing.name} goes its own way; only things whose motion is of kind "
                '"outside" can be put somewhere'
            )
        thing.motion.say(s_from_ns(time_ns), pose, velocity)

    def get_state(self) -> list[object]:
        """What a snapshot keeps: what was said from outside."""
        return [
            thing.motion.get_state() if isinstance(thing.motion, GivenMotion) else None
            for thing in self._things
        ]

    def set_state(self, state: Sequence[object]) -> None:
        """Go back to a kept state."""
        for thing, kept in zip(self._things, state, strict=True):
            if isinstance(thing.motion, GivenMotion):
                thing.motion.set_state(kept)
