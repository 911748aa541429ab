"""Publishes the grid map on `/map`, receives `/map_command` and serves changes of the map."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import (
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    Published,
    Quaternion,
    frame_of,
    header,
    single,
    time_from_ns,
)
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.services.results import Fields, offer_command
from volery.scenario.grid_map import RECEIVED, GridMapWorld
from volery.world.grid_maps import GridMap

_OURS = "volery_interfaces/srv"
_BLOCKED, _FREE = 100, 0
_BLOCKED_FROM = 50
"""Occupancy, in per cent, from which a cell is blocked."""
_MAX_COMPONENT = 1e6
"""Max component of a quaternion, which need not be of unit length."""
_LEVEL = 1e-3
"""Max x and y, relative to the norm, of the quaternion of a level origin."""


def offer_grid_maps(
    graph: Graph, world: GridMapManager, settings: GridMapWorld, now_ns: Callable[[], int]
) -> None:
    """Publishes the map on `/map`, latched; receives `/map_command`; creates the services."""
    publisher = graph.advertise("/map", OccupancyGrid, latched=True)

    def publish(grid: GridMap) -> None:
        publisher.publish(occupancy_of(grid, now_ns()))

    def receive(published: Published) -> None:
        present = world.current
        height_m = settings.block_height_m if present is None else present.block_height_m
        try:
            message: Any = published.message
            world.show(grid_of(message, height_m, unknown_is_blocked=settings.unknown_is_blocked))
        except CommandError as error:
            world.refuse(str(error))
            graph.refuse(published.topic, str(error))

    def change(request: Any) -> Fields:
        shown = world.change(
            request.name or None,
            block_height_m=request.block_height or None,
            cell_size_m=request.cell_size or None,
        )
        return {"message": shown.describe()}

    def get(_request: Any) -> Fields:
        grid = world.current
        if grid is None:
            return {"names": list(world.names)}
        return {
            "name": grid.name,
            "names": list(world.names),
            "block_height": grid.block_height_m,
            "cell_size": grid.cell_size_m,
            "rows": grid.rows,
            "columns": grid.columns,
        }

    world.on_change = publish
    if world.current is not None:
        publish(world.current)
    graph.subscribe("/map_command", receive, OccupancyGrid)
    offer_command(graph, "/volery/set_grid_map", f"{_OURS}/SetGridMap", change)
    offer_command(graph, "/volery/get_grid_map", f"{_OURS}/GetGridMap", get)


def occupancy_of(grid: GridMap, time_ns: int) -> OccupancyGrid:
    """Returns the map as a message: 100 blocked, 0 free."""
    data = np.where(grid.blocked, np.int8(_BLOCKED), np.int8(_FREE)).ravel()
    data.flags.writeable = False
    turn = rotations.from_yaw(grid.yaw_rad)
    info = MapMetaData(
        time_from_ns(time_ns),
        single(grid.cell_size_m),
        grid.columns,
        grid.rows,
        Pose(Point(*grid.origin_m, 0.0), Quaternion(*turn.tolist())),
    )
    return OccupancyGrid(header(time_ns, "map"), info, data)


def grid_of(message: Any, block_height_m: float, *, unknown_is_blocked: bool = False) -> GridMap:
    """Returns the map of a message. Raises `CommandError` if it is invalid.

    Cells of 50 per cent and more are blocked, unknown ones (-1) if `unknown_is_blocked`. The
    height of the origin is ignored: blocks stand on the ground.
    """
    info, origin = message.info, message.info.origin.position
    if frame_of(message) not in ("", "map"):
        raise CommandError(f"maps are in 'map', not in '{frame_of(message)}'")
    data: NDArray[np.int8] = np.asarray(message.data, dtype=np.int8)
    rows, columns = int(info.height), int(info.width)
    if data.size != rows * columns:
        raise CommandError(f"{columns} x {rows} cells need as many entries, not {data.size}")
    if not (math.isfinite(origin.x) and math.isfinite(origin.y) and math.isfinite(info.resolution)):
        raise CommandError("origin and resolution of a map must be finite")
    blocked = data >= _BLOCKED_FROM
    if unknown_is_blocked:
        blocked |= data < 0
    return GridMap(
        RECEIVED,
        blocked.reshape(rows, columns),
        float(info.resolution),
        block_height_m,
        (float(origin.x), float(origin.y)),
        _yaw(info.origin.orientation),
    )


def _yaw(turn: Any) -> float:
    q = np.array([turn.x, turn.y, turn.z, turn.w], dtype=np.float64)
    if not (np.abs(q) < _MAX_COMPONENT).all():
        raise CommandError(f"the origin of a map is turned by {q.tolist()}, which is no rotation")
    length = float(np.linalg.norm(q))
    if length == 0.0:  # the message has no orientation
        return 0.0
    if max(abs(q[0]), abs(q[1])) > _LEVEL * length:
        raise CommandError(f"the origin of a map turns about z alone, not by {q.tolist()}")
    return float(rotations.yaw_of(q / length))
