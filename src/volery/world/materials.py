"""Materials of surfaces, as rays report them."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np

from volery.core.data_tables import read_table


class Material(IntEnum):
    """Material number of a surface; it fits a uint8. It is compiled into kernels."""

    NONE = 0
    GROUND = 1
    WOOD = 2
    LEAF = 3
    UAV_BODY = 4
    ROTOR = 5
    WALL = 6
    BLOCK = 7
    CLOTHES = 8
    SKIN = 9
    CAR_PAINT = 10
    RUBBER = 11
    PLUMAGE = 12
    FACADE = 13
    """Outer wall with windows."""
    ROOF = 14
    ASPHALT = 15
    PAVING = 16
    METAL = 17
    PAINTED = 18
    """Paint in the colour of its solid."""
    PRINT_WHITE = 19
    PRINT_BLACK = 20
    UAV_GREY = 21
    """This and the next ones: plastic and metal of a UAV in the colours of its airframe."""
    UAV_WHITE = 22
    UAV_RED = 23
    UAV_ORANGE = 24
    UAV_AMBER = 25
    UAV_BLUE = 26
    UAV_GREEN = 27


_TABLE = read_table(__file__, "materials.toml")
PROPERTIES: dict[Material, dict[str, Any]] = {m: _TABLE[m.name] for m in Material}
"""Properties of surfaces by material; `materials.toml` explains them."""
REFLECTIVITY = np.array([surface["reflectivity"] for surface in PROPERTIES.values()])
"""(materials,) fraction of near-infrared light that a surface reflects, by `Material`."""
REFLECTIVITY.flags.writeable = False
