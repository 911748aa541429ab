"""Builds the messages of the coverage planner: areas, covered cells, paths, status."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.cells import Mask
from volery.autonomy.coverage.field import CoverageField
from volery.autonomy.coverage.flight import CoverageFlight
from volery.autonomy.coverage.plan import CoveragePlan
from volery.autonomy.coverage.waypoints import WaypointProgress
from volery.core import rotations
from volery.graph.messages import (
    MapMetaData,
    OccupancyGrid,
    PathMessage,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    header,
    single,
    time_from_ns,
)

KEEP_HEADING = Quaternion(0.0, 0.0, 0.0, 0.0)
"""Rotation of a goal that leaves the heading unchanged."""
_LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)


def areas_message(field: CoverageField, owner: NDArray[np.int16], now_ns: int) -> OccupancyGrid:
    """Returns UAV numbers of the cells from 1; 0: unreachable; -1: no visit needed."""
    return _grid(field, owner + 1, now_ns)


def covered_message(field: CoverageField, covered: Mask, now_ns: int) -> OccupancyGrid:
    """Returns the covered percentage of each free cell; -1 for blocked ones."""
    rows, columns = field.free.shape
    quarters = covered.reshape(rows, 2, columns, 2).sum(axis=(1, 3))
    return _grid(field, np.where(field.free, 25 * quarters, -1), now_ns)


def path_message(waypoints: WaypointProgress, now_ns: int) -> PathMessage:
    """Returns the path of one UAV's waypoints."""
    stamp = header(now_ns, "map")
    return PathMessage(
        stamp, [PoseStamped(stamp, Pose(Point(*p), _LEVEL)) for p in waypoints.positions]
    )


def goal_message(position: NDArray[np.float64], now_ns: int) -> PoseStamped:
    """Returns a goal in the map that leaves the heading unchanged."""
    return PoseStamped(header(now_ns, "map"), Pose(Point(*position.tolist()), KEEP_HEADING))


def status_message(
    flights: Sequence[CoverageFlight], plan: CoveragePlan | None, fraction: float, refused: str
) -> String:
    """Returns JSON: state, covered fraction, phase and cells of each UAV, reason of a refusal."""
    shares = [] if plan is None else plan.shares.tolist()
    status = {
        "state": "refused" if refused else "waiting" if plan is None else "flying",
        "covered": round(fraction, 4),
        "phases": {flight.name: str(flight.phase) for flight in flights},
        "cells": shares,
        "spread": 0 if plan is None else plan.spread,
        "unreachable": 0 if plan is None else plan.unreachable,
        "reason": refused,
    }
    return String(json.dumps(status))


def _grid(field: CoverageField, values: NDArray[np.generic], now_ns: int) -> OccupancyGrid:
    data = values.astype(np.int8).ravel()
    data.flags.writeable = False
    rows, columns = field.free.shape
    turn = Quaternion(*rotations.from_yaw(field.yaw).tolist())
    origin = Pose(Point(*field.origin_map, 0.0), turn)
    info = MapMetaData(time_from_ns(now_ns), single(field.cell_m), columns, rows, origin)
    return OccupancyGrid(header(now_ns, "map"), info, data)
