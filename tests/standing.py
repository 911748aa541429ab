"""Poses of vehicles that stand on the ground."""

import numpy as np

from volery.core import rotations
from volery.vehicle.airframe import Airframe
from volery.world.terrain import Terrain


def standing_pose(
    airframe: Airframe, terrain: Terrain, x: float, y: float, yaw: float
) -> np.ndarray:
    """Returns the pose (7,) x, y, z m, quaternion x y z w, of a vehicle on the ground at (x, y).

    The vehicle tilts with the ground; no foot is below the terrain.
    """
    normal = terrain.normal(x, y)
    tilt = np.array([-normal[1], normal[0], 0.0, 1.0 + normal[2]])
    attitude = rotations.multiply(rotations.normalize(tilt), rotations.from_rpy(0.0, 0.0, yaw))
    feet = rotations.rotate(attitude, np.array(airframe.ground.feet_m))
    ground = terrain.height(x + feet[:, 0], y + feet[:, 1])
    z = float((ground - feet[:, 2]).max())
    return np.concatenate([[x, y, z], attitude])
