"""Poses in the plane: (3,) x, y in m and yaw in rad."""

from __future__ import annotations

import math

import numpy as np

from volery.core.arrays import Array


def compose(pose: Array, step: Array) -> Array:
    """Returns the pose `step` from `pose`, along its axes."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array(
        [
            pose[0] + c * step[0] - s * step[1],
            pose[1] + s * step[0] + c * step[1],
            math.remainder(pose[2] + step[2], math.tau),
        ]
    )


def between(pose: Array, other: Array) -> Array:
    """Returns the step from `pose` to `other`."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = other[0] - pose[0], other[1] - pose[1]
    turn = math.remainder(other[2] - pose[2], math.tau)
    return np.array([c * dx + s * dy, c * dy - s * dx, turn])


def placed(points: Array, pose: Array) -> Array:
    """Returns points (K, 2) of a body at `pose` in the frame of the pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    moved: Array = points @ np.array([[c, s], [-s, c]]) + pose[:2]
    return moved


def turned(covariance: Array, yaw: float) -> Array:
    """Returns a covariance (3, 3) of x, y, yaw in axes rotated by -yaw."""
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    result: Array = turn @ covariance @ turn.T
    return result


def grown(covariance: Array, pose: Array, step: Array, of_step: Array) -> Array:
    """Returns the covariance (3, 3) of `compose(pose, step)`, in the frame of the pose.

    `covariance` is that of the pose, `of_step` that of the step in the pose's axes.
    """
    moved = compose(pose, step)
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = -(moved[1] - pose[1]), moved[0] - pose[0]
    result: Array = lever @ covariance @ lever.T + turned(of_step, float(pose[2]))
    return result
