"""Odometry whose frame is level, though the frame that the tracker's map lies in stands aslant."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.inertial_kernels import G, Q
from volery.autonomy.slam.keyframes import levelling
from volery.core import rotations
from volery.core.saved_state import restore_attributes, save_attributes

Array = NDArray[np.float64]


class LevelOdometry:
    """Adds up the tracker's motion, each piece turned level by what is known of gravity by then.

    So it neither jumps nor leans as gravity becomes known: whoever flies by it and by an IMU takes
    gravity to point straight down.
    """

    _STATE = ("_was", "position")

    def __init__(self) -> None:
        self._was: Array | None = None
        self.position = np.zeros(3)
        """(3,) m, where the vehicle is in it."""

    def follow(self, state: Array) -> tuple[Array, Array]:
        """Position (3,) and attitude (4,) in it, for a state (19,) of the tracker."""
        turn = levelling(state[G : G + 3])
        if self._was is None:
            self.position = state[:3].copy()
        else:
            self.position = self.position + rotations.rotate(turn, state[:3] - self._was)
        self._was = state[:3].copy()
        return self.position, rotations.multiply(turn, state[Q : Q + 4])

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return save_attributes(self, self._STATE)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        restore_attributes(self, state)
