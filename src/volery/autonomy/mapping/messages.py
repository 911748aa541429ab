"""Converts maps to messages and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import Voxels, decode_binary, decode_full
from volery.autonomy.mapping.projected_grid import ProjectedGrid, Scores, occupancy
from volery.core.errors import DataFileError
from volery.graph.messages import (
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    Quaternion,
    header,
    message_type,
    single,
    time_from_ns,
)

OCTOMAP: type[Any] = message_type("octomap_msgs/msg/Octomap")
_LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)


def octomap_message(
    data: NDArray[np.uint8], resolution_m: float, frame_id: str, now_ns: int
) -> Any:
    """Returns a binary stream as octomap_msgs/Octomap."""
    signed = data.view(np.int8)
    signed.flags.writeable = False
    return OCTOMAP(header(now_ns, frame_id), True, "OcTree", resolution_m, signed)


def voxels_of(message: Any) -> Voxels:
    """Returns the cubes of an octomap_msgs/Octomap. Raises DataFileError if it is invalid."""
    if message.id != "OcTree":
        raise DataFileError(f"an octomap of kind '{message.id}'; only OcTree is read")
    data = np.asarray(message.data).view(np.uint8)
    return decode_binary(data) if message.binary else decode_full(data)


def grid_message(grid: ProjectedGrid, height: float, frame_id: str, now_ns: int) -> OccupancyGrid:
    """Returns the known part of a grid; one unknown cell for an empty grid."""
    box = grid.known_box()
    if box is None or grid.origin is None:
        empty = np.full((1, 1), -1, np.int8)
        return grid_values_message(empty, grid.cell_m, (0.0, 0.0, height), frame_id, now_ns)
    rows, columns = box
    corner = (grid.origin + np.array([columns.start, rows.start])) * grid.cell_m
    origin = (float(corner[0]), float(corner[1]), height)
    return grid_values_message(
        occupancy(grid.score[rows, columns]), grid.cell_m, origin, frame_id, now_ns
    )


def grid_values_message(
    values: Scores, cell_m: float, corner: tuple[float, float, float], frame_id: str, now_ns: int
) -> OccupancyGrid:
    """Returns values (rows, columns) as nav_msgs/OccupancyGrid, lower left corner at `corner`."""
    data = values.astype(np.int8).ravel()
    data.flags.writeable = False
    rows, columns = values.shape
    return OccupancyGrid(
        header(now_ns, frame_id),
        MapMetaData(
            time_from_ns(now_ns), single(cell_m), columns, rows, Pose(Point(*corner), _LEVEL)
        ),
        data,
    )
