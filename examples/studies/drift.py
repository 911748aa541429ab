"""Metrics of the study `gusts.toml`: functions of a run's flight."""

import numpy as np


def drift_m(flight):
    """Returns the max horizontal distance from the start, m."""
    path = flight.position_map[0, :, :2]
    return float(np.linalg.norm(path - path[0], axis=1).max())


def holds(flight, limit_m):
    """Returns whether the UAV stays within `limit_m` of the start."""
    return drift_m(flight) < limit_m
