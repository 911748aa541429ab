"""Scenario data of grid maps: matrices of 0 and 1 whose cells become blocks."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, Vector2

MapName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=80)]
RECEIVED = "map_command"
"""Name of the latest map received over the graph."""
Side = Annotated[float, Field(ge=0.001, le=1000.0)]


class GridMapFile(Data):
    """A map in a file: .csv, .txt (0 and 1), .png, .pgm (dark is blocked), .map (movingai.com).

    A .yaml file of ROS' map_server brings its image, cell size, origin, yaw and thresholds.
    """

    file: str
    """File of the map."""
    name: MapName | None = None
    """Name of the map; None: the file's name without its suffix."""
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
    """Darkness above which a pixel is blocked, from 0 (white) to 1 (black); not of a .yaml file."""

    @model_validator(mode="after")
    def _has_a_name(self) -> Self:
        if not self.called:
            raise ValueError("name is needed if the file's name does not begin with a letter")
        return self

    @property
    def called(self) -> str:
        """Name of the map."""
        return self.name if self.name is not None else PurePosixPath(self.file).stem


class GridMapWorld(Data):
    """Maps to choose from, and the size of their blocks."""

    maps: tuple[GridMapFile, ...] = ()
    """Empty: no blocks until a map is received over the graph."""
    map: str | None = None
    """Name of the map at the start; None: the first."""
    cell_size_m: Side = 1.0
    """Side of a cell; a .yaml file has its own."""
    block_height_m: Side = 5.0
    """Height of the blocks above the ground."""
    origin_m: Vector2 = (0.0, 0.0)
    """Lower left corner of a file's map; a .yaml file has its own."""
    unknown_is_blocked: bool = False
    """Whether unknown cells become blocks: -1 in a `nav_msgs/OccupancyGrid`, and in .yaml maps."""

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        names = [each.called for each in self.maps]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"names of maps must differ; used twice: {', '.join(twice)}")
        if RECEIVED in names:
            raise ValueError(
                f"'{RECEIVED}' is reserved for the map received over the graph; choose another name"
            )
        if self.map is not None and self.map not in names:
            known = ", ".join(names) or "none"
            raise ValueError(f"map '{self.map}' is not among the maps; known: {known}")
        return self

    @property
    def starting(self) -> str | None:
        """Name of the map at the start, None without maps."""
        if self.map is None and self.maps:
            return self.maps[0].called
        return self.map
