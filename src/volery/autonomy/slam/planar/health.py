"""Health of the planar tracking: a state, and problems as text."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S

_SILENT_NS = NS_PER_S
_UNSURE_M = 0.5
"""Max standard deviation of the position by scans alone, within the last second's motion."""


class PlanarHealth(NamedTuple):
    """Inputs of the check."""

    now_ns: int
    received_ns: int
    """Time of the last scan."""
    period_ns: int
    """Usual time between two scans."""
    odometry_ns: int | None
    """Time of the last odometry; None: there was none."""
    has_begun: bool
    misfits: int
    is_blind: bool
    is_open: bool
    """Whether scans leave a direction unconstrained, as in a corridor."""
    is_placed: bool


def judged(it: PlanarHealth) -> tuple[str, list[str]]:
    """Returns the state (starting, tracking, degraded, lost) and the problems."""
    problems = []
    long = max(_SILENT_NS, 4 * it.period_ns)
    if it.now_ns - it.received_ns > long:
        problems.append("the LIDAR is silent")
    if it.odometry_ns is not None and it.now_ns - it.odometry_ns > long:
        problems.append("the odometry is silent")
    if it.is_blind:
        problems.append("too few returns in range")
    if not it.has_begun:
        return "starting", problems
    if it.misfits:
        problems.append("scans do not match the map")
    if it.is_open:
        problems.append("scans leave one direction unconstrained")
    if not it.is_placed:
        problems.append("pose in the map unknown")
        return "lost", problems
    return ("degraded" if problems else "tracking"), problems


def is_open(information: NDArray[np.float64]) -> bool:
    """Returns whether a scan's information (3, 3) leaves a direction unconstrained."""
    return bool(np.linalg.eigvalsh(information[:2, :2])[0] < 1.0 / _UNSURE_M**2)
