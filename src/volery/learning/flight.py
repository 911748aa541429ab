"""What the functions of a task see: the flights of all environments, as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.draws import Draws
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.vehicle.fleet import FleetState


class Flight:
    """K environments of n UAVs at the present decision.

    Arrays must not be changed, apart from those in `values`.
    """

    def __init__(
        self, envs: VectorizedSimulation, action_size: int, decision_rate_hz: float
    ) -> None:
        self.envs = envs
        self.decision_rate_hz = decision_rate_hz
        self.num_envs = envs.num_envs
        self.num_uavs = len(envs.uav_names)
        self.airframe = envs.airframes[0]
        self.draws = Draws(self.num_envs)
        """Random numbers of the environments."""
        self.values: dict[str, Array] = {}
        """Arrays (K, ...) of the task by name, such as goals."""
        self.action: Array = np.zeros((self.num_envs, self.num_uavs, action_size))
        """(K, n, A) last actions."""
        self.previous_action: Array = np.zeros_like(self.action)
        """(K, n, A) actions before those."""
        self.decisions: NDArray[np.int64] = np.zeros(self.num_envs, np.int64)
        """(K,) decisions since the start of the episode."""
        self._state: FleetState | None = None
        self._attitude_inverse: Array | None = None

    def refresh(self) -> None:
        """Marks the state as changed."""
        self._state = self._attitude_inverse = None

    @property
    def state(self) -> FleetState:
        """State of all UAVs, arrays (K, n, ...); see `FleetState` for units and frames."""
        if self._state is None:
            self._state = self.envs.state()
        return self._state

    def to_body(self, vectors_map: Array) -> Array:
        """Returns vectors (K, n, 3) of the map frame in the body frames (FLU)."""
        if self._attitude_inverse is None:
            self._attitude_inverse = rotations.conjugate(self.state.attitude)
        return rotations.rotate(self._attitude_inverse, vectors_map)

    def to_heading(self, vectors_map: Array) -> Array:
        """Returns vectors (K, n, 3) of the map frame in the level heading frames."""
        yaw = rotations.yaw_of(self.state.attitude)
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, z = np.moveaxis(vectors_map, -1, 0)
        return np.stack([c * x + s * y, c * y - s * x, z], axis=-1)
