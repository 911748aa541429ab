"""Optimizes the pose graph of keyframes: odometry edges and loop closures.

Tilt is known from gravity, so a keyframe has four values: x, y and yaw in a gtsam graph of Pose2,
and height beside it. Loop closures have a robust kernel (Geman-McClure); the optimizer is
Levenberg-Marquardt with a bounded number of iterations.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import NodeError
from volery.core.extras import import_extra

_ROUNDS = 12


class PoseGraphEdge(NamedTuple):
    """Pose of keyframe `to` relative to keyframe `origin`."""

    origin: int
    to: int
    measured: Array
    """(4,) x, y, z in m along the levelled axes of `origin`, and yaw, rad."""
    sigmas: Array
    """(4,) standard deviations."""
    is_closure: bool = False


def compose(pose: Array, step: Array) -> Array:
    """Returns the pose (4,) x, y, z, yaw that lies `step` (4,) from `pose`."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    return np.array(
        [
            pose[0] + c * step[0] - s * step[1],
            pose[1] + s * step[0] + c * step[1],
            pose[2] + step[2],
            math.remainder(pose[3] + step[3], math.tau),
        ]
    )


def between(pose: Array, other: Array) -> Array:
    """Returns the step (4,) from `pose` to `other`."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    dx, dy = other[0] - pose[0], other[1] - pose[1]
    turn = math.remainder(other[3] - pose[3], math.tau)
    return np.array([c * dx + s * dy, c * dy - s * dx, other[2] - pose[2], turn])


def optimised(poses: list[Array], edges: list[PoseGraphEdge]) -> list[Array]:
    """Returns the poses (4,) that fit the edges best; the first one is fixed."""
    gtsam = load_gtsam()
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    heights = len(poses)
    for k, pose in enumerate(poses):
        start.insert(k, gtsam.Pose2(float(pose[0]), float(pose[1]), float(pose[3])))
        start.insert(heights + k, float(pose[2]))
    tight = gtsam.noiseModel.Isotropic.Sigma
    graph.add(gtsam.PriorFactorPose2(0, start.atPose2(0), tight(3, 1e-4)))
    graph.add(gtsam.PriorFactorDouble(heights, float(poses[0][2]), tight(1, 1e-4)))
    for edge in edges:
        _add(gtsam, graph, edge, heights)
    settings = gtsam.LevenbergMarquardtParams()
    settings.setMaxIterations(_ROUNDS)
    found = gtsam.LevenbergMarquardtOptimizer(graph, start, settings).optimize()
    result = []
    for k in range(heights):
        pose = found.atPose2(k)
        z = found.atDouble(heights + k)
        result.append(np.array([pose.x(), pose.y(), z, pose.theta()]))
    return result


def _add(gtsam: Any, graph: Any, edge: PoseGraphEdge, heights: int) -> None:
    m, sigmas = edge.measured, edge.sigmas
    plane = gtsam.noiseModel.Diagonal.Sigmas(np.array([sigmas[0], sigmas[1], sigmas[3]]))
    height = gtsam.noiseModel.Isotropic.Sigma(1, float(sigmas[2]))
    if edge.is_closure:
        robust = gtsam.noiseModel.Robust.Create
        kernel = gtsam.noiseModel.mEstimator.GemanMcClure.Create(5.0)
        plane, height = robust(kernel, plane), robust(kernel, height)
    turned = gtsam.Pose2(float(m[0]), float(m[1]), float(m[3]))
    graph.add(gtsam.BetweenFactorPose2(edge.origin, edge.to, turned, plane))
    one, two = heights + edge.origin, heights + edge.to
    graph.add(gtsam.BetweenFactorDouble(one, two, float(m[2]), height))


def load_gtsam() -> Any:
    """Returns the gtsam module. Raises `NodeError` if it cannot be imported."""
    what = "slam (unless loop_closures = false)"
    return import_extra(what, "gtsam", "gtsam", "autonomy", NodeError)
