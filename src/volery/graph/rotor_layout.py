"""Positions of a UAV's rotors, for bridges to autopilots that drive each rotor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple


class RotorPosition(NamedTuple):
    """Position of a rotor, m, FLU, and its direction of rotation seen from above."""

    x: float
    y: float
    direction: Literal["ccw", "cw"]


RotorLayout = Sequence[RotorPosition]
"""All rotors of a UAV, in the order of its airframe."""
