"""Drives Crazyflow with its state controller on the CPU, with its own interpreter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from crazyflow.control import Control
from crazyflow.dynamics import Dynamics
from crazyflow.sim import Sim

_POSITION_HZ = 100
"""Default rate of its position layer, Hz; attitude and torques run at every step."""
_COMMAND = 16
"""Position, velocity, acceleration, attitude (x y z w), body rates."""
_QUATERNION_W = 12


def prepare(request: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[], dict[str, Any]]]:
    """Returns functions: a round of `steps` in one call; the drones' max position error, m."""
    rate = request["rate_hz"]
    sim = Sim(
        n_worlds=request["worlds"],
        n_drones=request["drones"],
        dynamics=Dynamics.first_principles,
        control=Control.state,
        freq=rate,
        state_freq=_POSITION_HZ,
        attitude_freq=rate,
        force_torque_freq=rate,
        device="cpu",
    )
    sim.reset()
    shape = (request["worlds"], request["drones"])
    positions = np.broadcast_to(np.float32(request["places"]), (*shape, 3))
    states = sim.data.states.replace(pos=jax.numpy.asarray(positions))
    sim.data = sim.data.replace(states=states)
    command = np.zeros((*shape, _COMMAND), np.float32)
    command[..., :3] = positions
    command[..., _QUATERNION_W] = 1.0
    sim.state_control(command)

    def advance() -> None:
        sim.step(request["steps"])
        jax.block_until_ready(sim.data.states.pos)

    def facts() -> dict[str, Any]:
        now = np.asarray(sim.data.states.pos)
        return {"position_error_m": float(np.linalg.norm(now - positions, axis=-1).max())}

    return advance, facts
