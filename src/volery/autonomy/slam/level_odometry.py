"""Odometry in a level frame, although the frame of the tracker's map may be tilted."""

from __future__ import annotations

import numpy as np

from volery.autonomy.slam.inertial_kernels import G, Q
from volery.autonomy.slam.keyframes import levelling
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes


class LevelOdometry(SavedAttributes):
    """Integrates the tracker's motion; each step is levelled by the current estimate of gravity.

    So the odometry neither jumps nor tilts as the estimate improves: users combine it with an IMU
    and assume that gravity points straight down.
    """

    STATE = ("_was", "position")

    def __init__(self) -> None:
        self._was: Array | None = None
        self.position = np.zeros(3)
        """(3,) m, position of the vehicle in the level frame."""

    def follow(self, state: Array) -> tuple[Array, Array]:
        """Returns position (3,) and attitude (4,) in the level frame, for a tracker state (19,)."""
        turn = levelling(state[G : G + 3])
        if self._was is None:
            self.position = state[:3].copy()
        else:
            self.position = self.position + rotations.rotate(turn, state[:3] - self._was)
        self._was = state[:3].copy()
        return self.position, rotations.multiply(turn, state[Q : Q + 4])
