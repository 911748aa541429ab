"""Scenario data of user meshes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from volery.core.quantities import Quantity
from volery.scenario.base import PROJECTED, Data, Positive, Vector3

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class UserMesh(Data):
    """A glTF, OBJ or STL file as an object in the world."""

    quantities: ClassVar[Mapping[str, Quantity]] = {"position_m": PROJECTED}

    file: str
    """File of the mesh: .glb, .gltf, .obj or .stl."""
    name: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    """Name in messages; None: the file's name without its suffix."""
    position_m: Vector3 = (0.0, 0.0, 0.0)
    """Position of the file's origin in the map; for projected coordinates their negative values."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the file's axes, turned z up, in the map."""
    scale: Annotated[float, Field(gt=0.0, le=1e6)] | tuple[Positive, Positive, Positive] = 1.0
    """Metres per unit of the file; three numbers scale x, y and z after turning z up."""
    up: Literal["y", "z"] | None = None
    """Vertical axis of the file; None: y for glTF, as in its standard, else z."""
    material: Literal["painted", "wall", "wood", "metal", "paving", "asphalt", "roof", "ground"] = (
        "painted"
    )
    """Material for LIDARs and cameras; `painted` has a colour."""
    colour: tuple[Share, Share, Share] | None = None
    """Linear red, green, blue of a painted mesh; None: the file's base colour, else grey."""
