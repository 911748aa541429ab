"""Compiled turning rotors: whether a ray through a disc hits a blade.

A rotor is two opposite blades and a hub. Their shape is a modelling choice for small propellers:
the chord falls linearly from .22 of the radius at the axis to .10 at the tip, which fills .10 of
the disc, and the hub with the motor has .12 of the radius. Blades are flat and lie in the disc.
"""

from __future__ import annotations

import numpy as np

from volery.core.compiled import inner_kernel
from volery.world.scene_memory import BodyTable

DISC_SIDES = 16
"""Number of triangles of a rotor disc's mesh."""
_HUB = 0.12
_ROOT, _TAPER = 0.22, 0.12


@inner_kernel
def meets_blade(
    bodies: BodyTable, row: int, triangle: int, fraction: float, x: float, y: float, z: float
) -> bool:
    """Returns whether a point of a rotor's disc, body frame, is on a blade or the hub.

    triangle: its number in the mesh of all discs of a body. fraction: of the interval of motion.
    """
    rotor = min(triangle // DISC_SIDES, bodies.rotors.shape[1] - 1)
    rotor_row, turn = bodies.rotors[row, rotor], bodies.turn[row, rotor]
    dx, dy, dz = x - rotor_row[0], y - rotor_row[1], z - rotor_row[2]
    a = dx * rotor_row[3] + dy * rotor_row[4] + dz * rotor_row[5]
    b = dx * rotor_row[6] + dy * rotor_row[7] + dz * rotor_row[8]
    radius = rotor_row[9]
    away = np.sqrt(a * a + b * b)
    if radius == 0.0 or away <= _HUB * radius:  # no radius: not a turning rotor
        return True
    angle = turn[0] + fraction * (turn[1] - turn[0])
    beside = abs(b * np.cos(angle) - a * np.sin(angle))
    return bool(2.0 * beside <= _ROOT * radius - _TAPER * away)
