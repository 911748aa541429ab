"""Optimizes the planar pose graph of keyframes by gtsam."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.slam.planar.poses import between
from volery.autonomy.slam.pose_graph import load_gtsam
from volery.core.arrays import Array

_ROUNDS = 20
_BEND = 3.0
"""Standard deviations at which a closure begins to lose weight (Cauchy's kernel)."""
_MAX_SIGMAS = 7.0
"""Max deviation of a closure after the optimization, in standard deviations; else it is removed."""


class PlanarEdge(NamedTuple):
    """Pose of keyframe `to` relative to keyframe `origin`."""

    origin: int
    to: int
    measured: Array
    """(3,) x, y, yaw along the axes of `origin`."""
    information: Array
    """(3, 3)."""
    is_closure: bool = False


def optimised(poses: list[Array], edges: list[PlanarEdge]) -> tuple[list[Array], list[PlanarEdge]]:
    """Returns the optimized poses (3,), first one fixed, and the edges without outliers."""
    found = _solved(poses, edges)
    kept = [edge for edge in edges if not edge.is_closure or _misfit(found, edge) <= _MAX_SIGMAS]
    if len(kept) < len(edges):
        found = _solved(poses, kept)
    return found, kept


def _misfit(poses: list[Array], edge: PlanarEdge) -> float:
    """Returns the deviation of an edge from its measurement, in standard deviations."""
    seen = between(poses[edge.origin], poses[edge.to])
    away = between(edge.measured, seen)
    return math.sqrt(max(float(away @ edge.information @ away), 0.0))


def _solved(poses: list[Array], edges: list[PlanarEdge]) -> list[Array]:
    gtsam = load_gtsam()
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, pose in enumerate(poses):
        start.insert(k, gtsam.Pose2(*map(float, pose)))
    tight = gtsam.noiseModel.Isotropic.Sigma(3, 1e-4)
    graph.add(gtsam.PriorFactorPose2(0, start.atPose2(0), tight))
    for edge in edges:
        graph.add(_factor(gtsam, edge))
    settings = gtsam.LevenbergMarquardtParams()
    settings.setMaxIterations(_ROUNDS)
    found = gtsam.LevenbergMarquardtOptimizer(graph, start, settings).optimize()
    solved = (found.atPose2(k) for k in range(len(poses)))
    return [np.array([pose.x(), pose.y(), pose.theta()]) for pose in solved]


def _factor(gtsam: Any, edge: PlanarEdge) -> Any:
    noise = gtsam.noiseModel.Gaussian.Information(np.asfortranarray(edge.information))
    if edge.is_closure:
        kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(_BEND)
        noise = gtsam.noiseModel.Robust.Create(kernel, noise)
    step = gtsam.Pose2(*map(float, edge.measured))
    return gtsam.BetweenFactorPose2(edge.origin, edge.to, step, noise)
