"""What a surface is made of, as a ray reports it."""

from __future__ import annotations

from enum import IntEnum


class Material(IntEnum):
    """Material number of a surface; it fits a uint8."""

    NONE = 0
    GROUND = 1
    WOOD = 2
    LEAF = 3
    UAV_BODY = 4
    ROTOR = 5
    WALL = 6
