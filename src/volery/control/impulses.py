"""Contact impulses between UAVs, and between UAVs and obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from volery.control.setpoints import checked
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.vectors import norm
from volery.vehicle.airframe import Airframe
from volery.vehicle.fleet import FleetState


def collide(
    airframes: Sequence[Airframe],
    state: FleetState,
    i: int,
    j: int | None,
    normal_map: ArrayLike,
    restitution: float,
    friction: float,
    point_map: ArrayLike | None,
) -> float:
    """Applies a contact impulse to UAV `i`, and to `j` unless None; returns its size, N s.

    normal_map: (3,) unit vector into `i`, out of `j` or the fixed object. point_map: (3,) m, the
    contact; None: the impulse acts at the centres of mass. Friction is Coulomb's. The impulse is 0
    if the two already separate.
    """
    normal = checked("normal", normal_map, (3,), 1.1)
    normal = normal / norm(normal)
    sides = [(i, 1.0)] if j is None else [(i, 1.0), (j, -1.0)]
    velocity = np.zeros(3)
    softness = np.zeros((3, 3))
    spins: list[Array | None] = []
    for row, sign in sides:
        own_softness = np.eye(3) / airframes[row].body.mass_kg
        own_velocity, spin = state.velocity_map[row], None
        if point_map is not None:
            lever = np.asarray(point_map, dtype=np.float64) - state.position_map[row]
            turn = rotations.matrix(state.attitude[row])
            cross = np.cross(np.eye(3), lever)  # cross @ f = lever x f
            inverse = turn @ np.diag(1.0 / np.array(airframes[row].body.inertia_kg_m2)) @ turn.T
            spin = turn.T @ inverse @ cross
            own_softness = own_softness - cross @ inverse @ cross
            own_velocity = own_velocity + np.cross(turn @ state.omega_body[row], lever)
        spins.append(spin)
        softness += own_softness
        velocity += sign * own_velocity
    closing = -float(velocity @ normal)
    if closing <= 0.0:
        return 0.0
    push = (1.0 + restitution) * closing / float(normal @ softness @ normal)
    impulse = push * normal
    across = velocity + closing * normal
    slide = norm(across)
    if slide > 1e-9:
        along = across / slide
        hold = min(friction * push, slide / float(along @ softness @ along))
        impulse = impulse - hold * along
    for (row, sign), spin in zip(sides, spins, strict=True):
        mass = airframes[row].body.mass_kg
        state.velocity_map[row] += sign * impulse / mass
        if spin is not None:
            state.omega_body[row] += sign * (spin @ impulse)
    return norm(impulse)
