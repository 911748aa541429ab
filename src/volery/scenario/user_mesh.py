"""Scenario data of meshes of the user's own."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from volery.scenario.base import Data, Positive, Vector3

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class UserMesh(Data):
    """A glTF, OBJ or STL file that stands in the world."""

    file: str
    name: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    """In messages; None: the file's name without its ending."""
    position_m: Vector3 = (0.0, 0.0, 0.0)
    """Place of the file's origin in the map."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the file's axes, turned z up, in the map."""
    scale: Annotated[float, Field(gt=0.0, le=1e6)] | tuple[Positive, Positive, Positive] = 1.0
    """Metres of one unit of the file; three numbers stretch along x, y and z after turning z up."""
    up: Literal["y", "z"] | None = None
    """Which of the file's axes points up; None: y for glTF, as its standard says, else z."""
    material: Literal["painted", "wall", "wood", "metal", "paving", "asphalt", "roof", "ground"] = (
        "painted"
    )
    """What LIDARs and cameras take it for; `painted` has a colour."""
    colour: tuple[Share, Share, Share] | None = None
    """Linear red, green, blue of a painted mesh; None: the file's own base colour, else grey."""
