"""The motion that controllers use: ground truth, or an estimate with errors.

An estimator runs at about 200 Hz, control at every step. The error of an estimate changes slowly,
so the last error is held and added to the true motion: between two estimates the state continues as
with the integrated IMU of a real autopilot.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, product, three

BELIEF = np.dtype(
    [
        ("rate_error", "f8", 3),  # rad/s
        ("attitude", "f8", 4),  # map from body
        ("position_map", "f8", 3),  # m
        ("velocity_map", "f8", 3),  # m/s
        ("position_error", "f8", 3),  # m, map
        ("velocity_error", "f8", 3),  # m/s, map
        ("rotation_error", "f8", 4),  # estimated attitude = this * true attitude
    ],
    align=True,
)
"""The estimated motion and its error; see `CONTROL_STATE.errs`."""


class EstimatedState(NamedTuple):
    """Position (3,) m, velocity (3,) m/s, attitude (4,) of one UAV, map frame."""

    position: Array
    velocity: Array
    attitude: Array


def new_beliefs(count: int) -> NDArray[np.void]:
    """Returns the estimated states (N,) of UAVs without estimation error."""
    rows = np.zeros(count, BELIEF)
    rows["rotation_error"][:, 3] = 1.0
    return rows


@inner_kernel
def believed_rates(belief: Any, body: Any, errs: bool) -> tuple[float, float, float]:
    """Returns the estimated body rates, rad/s; `errs` false skips reading `belief`."""
    x, y, z = three(body.omega_body)
    if errs:
        ex, ey, ez = three(belief.rate_error)
        x, y, z = x + ex, y + ey, z + ez
    return x, y, z


@inner_kernel
def believe_attitude(belief: Any, body: Any, errs: bool) -> None:
    """Updates the estimated attitude."""
    x, y, z, w = four(body.attitude)
    if errs:
        ex, ey, ez, ew = four(belief.rotation_error)
        x, y, z, w = product(ex, ey, ez, ew, x, y, z, w)
    attitude = belief.attitude
    attitude[0], attitude[1], attitude[2], attitude[3] = x, y, z, w


@inner_kernel
def believe_position(belief: Any, body: Any) -> None:
    """Updates the estimated position and velocity."""
    for k in range(3):
        belief.position_map[k] = body.position_map[k] + belief.position_error[k]
        belief.velocity_map[k] = body.velocity_map[k] + belief.velocity_error[k]
