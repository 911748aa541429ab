"""Predicts the motion between two scans: by odometry, or at constant velocity.

A Kalman filter of pose and velocity. Without odometry the velocity along the body's axes changes by
white accelerations. In directions that scans leave open, such as along a plain corridor, the motion
continues at the last velocity, and its covariance grows with the third power of the time.
"""

from __future__ import annotations

import math

import numpy as np

from volery.autonomy.slam.planar.poses import compose, turned
from volery.autonomy.slam.planar.settings import MotionSettings
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes

_MIN_M, _MIN_RAD = 1e-3, 3e-4
"""Min standard deviations of a prediction."""
_FIRST_M_S, _FIRST_RAD_S = 1.0, 1.0
_LONGEST_S = 3.0
"""Max duration of a constant-velocity prediction; after it the velocity is unknown."""


class PlanarMotion(SavedAttributes):
    """Holds pose (3,), velocity (3,) in the body's axes, and their covariance (6, 6)."""

    STATE = ("pose", "velocity", "covariance")

    def __init__(self, settings: MotionSettings) -> None:
        self._settings = settings
        self.pose = np.zeros(3)
        self.velocity = np.zeros(3)
        self.covariance = np.diag([0.0] * 3 + [_FIRST_M_S**2] * 2 + [_FIRST_RAD_S**2])

    def forget_velocity(self) -> None:
        """Resets the velocity to unknown."""
        self.velocity = np.zeros(3)
        self.covariance[:3, 3:] = self.covariance[3:, :3] = 0.0
        self.covariance[3:, 3:] = np.diag([_FIRST_M_S**2] * 2 + [_FIRST_RAD_S**2])

    def move(self, dt: float, step: Array | None) -> Array:
        """Predicts the pose after `dt` s; `step` (3,) is the odometry's, None: no odometry.

        Returns the covariance (3, 3) that the step adds, in the axes of the body before it.
        """
        if step is not None:
            return self._by_odometry(dt, step)
        if dt > _LONGEST_S:
            self.forget_velocity()
        return self._going_on(min(dt, _LONGEST_S))

    def _by_odometry(self, dt: float, step: Array) -> Array:
        s = self._settings
        distance, turn = math.hypot(step[0], step[1]), abs(float(step[2]))
        along = s.odometry_m + s.odometry_per_m * distance
        yaw = s.odometry_rad + s.odometry_rad_per_m * distance + s.odometry_rad_per_rad * turn
        added = np.diag([along**2, along**2, yaw**2])
        before = float(self.pose[2])
        lever = self._lever(step)
        self.pose = compose(self.pose, step)
        own = lever @ self.covariance[:3, :3] @ lever.T + turned(added, before)
        self.velocity = step / dt if dt > 0.0 else np.zeros(3)
        of_velocity = added / max(dt, 0.02) ** 2
        self.covariance = np.zeros((6, 6))
        self.covariance[:3, :3], self.covariance[3:, 3:] = own, of_velocity
        return added

    def _going_on(self, dt: float) -> Array:
        s = self._settings
        yaw = float(self.pose[2])
        step = self.velocity * dt
        middle = yaw + 0.5 * step[2]
        f = np.eye(6)
        f[:3, :3] = self._lever(step)
        c, d = math.cos(middle), math.sin(middle)
        f[:3, 3:] = dt * np.array([[c, -d, 0.0], [d, c, 0.0], [0.0, 0.0, 1.0]])
        density = np.diag([s.accel_m2_s3, s.accel_m2_s3, s.turn_rad2_s3])
        noise = np.zeros((6, 6))
        noise[:3, :3] = density * dt**3 / 3.0
        noise[:3, 3:] = noise[3:, :3] = density * dt**2 / 2.0
        noise[:3, 3:] = turned(density, middle) @ f[:3, 3:] * dt / 2.0
        noise[3:, :3] = noise[:3, 3:].T
        noise[3:, 3:] = density * dt
        of_velocity = self.covariance[3:, 3:]
        self.pose = np.array(
            [
                self.pose[0] + c * step[0] - d * step[1],
                self.pose[1] + d * step[0] + c * step[1],
                math.remainder(yaw + step[2], math.tau),
            ]
        )
        added = density * dt**3 / 3.0 + of_velocity * dt**2
        self.covariance = f @ self.covariance @ f.T + noise
        return np.asarray(added)

    def _lever(self, step: Array) -> Array:
        """Returns the derivative (3, 3) of the moved pose by the pose."""
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        lever = np.eye(3)
        lever[0, 2] = -(s * step[0] + c * step[1])
        lever[1, 2] = c * step[0] - s * step[1]
        return lever

    @property
    def certainty(self) -> Array:
        """Information (3, 3) on the pose."""
        minimum = np.diag([_MIN_M**2, _MIN_M**2, _MIN_RAD**2])
        return np.asarray(np.linalg.inv(self.covariance[:3, :3] + minimum))

    def correct(self, pose: Array, information: Array) -> None:
        """Sets the pose (3,) that scan and motion together make most likely.

        information: (3, 3) of the scan alone.
        """
        own = self.covariance[:3, :3] + np.diag([_MIN_M**2, _MIN_M**2, _MIN_RAD**2])
        after = np.linalg.inv(np.linalg.inv(own) + information)
        away = pose - self.pose
        away[2] = math.remainder(float(away[2]), math.tau)
        gain = self.covariance[3:, :3] @ np.linalg.inv(own)
        self.velocity = self.velocity + gain @ away
        rest = self.covariance[3:, 3:] - gain @ (own - after) @ gain.T
        self.covariance[3:, 3:] = 0.5 * (rest + rest.T)
        self.covariance[3:, :3] = gain @ after
        self.covariance[:3, 3:] = self.covariance[3:, :3].T
        self.covariance[:3, :3] = 0.5 * (after + after.T)
        self.pose = np.array([pose[0], pose[1], math.remainder(float(pose[2]), math.tau)])
