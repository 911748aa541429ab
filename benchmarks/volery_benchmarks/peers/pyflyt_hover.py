"""Drives PyFlyt's `Aviary` with position control, with its own interpreter (see `host`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from PyFlyt.core import Aviary

_POSITION = 7
"""Flight mode for x, y, yaw, z."""


def prepare(request: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[], dict[str, Any]]]:
    """Returns functions: a round of `steps`; the drones' max position error, m."""
    if request["worlds"] != 1:
        raise ValueError("an Aviary is one world")
    positions = np.array(request["places"])
    aviary = Aviary(
        start_pos=positions,
        start_orn=np.zeros_like(positions),
        drone_type="quadx",
        drone_options={"control_hz": request["rate_hz"]},
        physics_hz=request["rate_hz"],
        seed=1,
    )
    aviary.set_mode(_POSITION)
    yaw = np.zeros(len(positions))
    aviary.set_all_setpoints(np.column_stack([positions[:, :2], yaw, positions[:, 2]]))

    def advance() -> None:
        for _ in range(request["steps"]):
            aviary.step()

    def facts() -> dict[str, Any]:
        now = np.array([state[3] for state in aviary.all_states])
        return {"position_error_m": float(np.linalg.norm(now - positions, axis=1).max())}

    return advance, facts
