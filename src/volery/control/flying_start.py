"""Starts of many UAVs in flight, as arrays; `Fleet.put` and `Fleet.push` do it for single UAVs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array


class FlyingStart(NamedTuple):
    """Motion of K UAVs."""

    position_map: Array
    """(K, 3) m."""
    attitude: Array
    """(K, 4) unit quaternions, map from body."""
    velocity_map: Array
    """(K, 3) m/s."""
    omega_body: Array
    """(K, 3) rad/s, FLU."""

    def rows(self, chosen: NDArray[np.int64]) -> FlyingStart:
        """Returns the motion of the UAVs `chosen` of these."""
        return FlyingStart(*(array[chosen] for array in self))


def set_motion(uavs: NDArray[np.void], rows: NDArray[np.int64], start: FlyingStart) -> None:
    """Sets the motion of the UAVs `rows` (K,), which brake at another position.

    uavs: (N,) rows of `fused_step.UAV`.
    """
    bodies, control_states = uavs["body"], uavs["control_state"]
    bodies["position_map"][rows] = start.position_map
    bodies["attitude"][rows] = start.attitude
    bodies["velocity_map"][rows] = start.velocity_map
    bodies["omega_body"][rows] = start.omega_body
    yaw = rotations.yaw_of(start.attitude)
    heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
    control_states["position"][rows] = control_states["position_target"][rows] = start.position_map
    control_states["velocity"][rows] = start.velocity_map
    control_states["heading"][rows] = control_states["heading_target"][rows] = heading
