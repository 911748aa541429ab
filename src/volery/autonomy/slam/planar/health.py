"""Whether the motion is followed: in words, and as a state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S

_SILENT_NS = NS_PER_S
_UNSURE_M = 0.5
"""Standard deviation of the place that the scans alone leave, of the last second's way."""


class PlanarHealth(NamedTuple):
    """What is looked at."""

    now_ns: int
    heard_ns: int
    """When the LIDAR was last heard of."""
    period_ns: int
    """Usual time between two scans."""
    odometry_ns: int | None
    """When the odometry was; None: it never was."""
    has_begun: bool
    misfits: int
    is_blind: bool
    is_open: bool
    """Whether what is seen leaves a direction open, as a corridor does."""
    is_placed: bool


def judged(it: PlanarHealth) -> tuple[str, list[str]]:
    """State (starting, tracking, degraded, lost) and what is wrong."""
    problems = []
    long = max(_SILENT_NS, 4 * it.period_ns)
    if it.now_ns - it.heard_ns > long:
        problems.append("the LIDAR is silent")
    if it.odometry_ns is not None and it.now_ns - it.odometry_ns > long:
        problems.append("the odometry is silent")
    if it.is_blind:
        problems.append("too few things in reach")
    if not it.has_begun:
        return "starting", problems
    if it.misfits:
        problems.append("what is seen is not what was there")
    if it.is_open:
        problems.append("what is seen leaves the way along it open")
    if not it.is_placed:
        problems.append("where in the map is not known")
        return "lost", problems
    return ("degraded" if problems else "tracking"), problems


def is_open(information: NDArray[np.float64]) -> bool:
    """Whether a scan's information (3, 3) leaves a direction of the place open."""
    return bool(np.linalg.eigvalsh(information[:2, :2])[0] < 1.0 / _UNSURE_M**2)
