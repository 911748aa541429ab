"""What the coverage planner tells: areas, what is covered, paths, as messages."""

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
"""As the rotation of a goal: the heading stays as it is."""
_LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)


def areas_message(field: CoverageField, owner: NDArray[np.int16], now_ns: int) -> OccupancyGrid:
    """Number of the UAV of each cell from 1; 0: nobody can reach it; -1: nobody need visit it."""
    return _grid(field, owner + 1, now_ns)


def covered_message(field: CoverageField, covered: Mask, now_ns: int) -> OccupancyGrid:
    """How much of each free cell is covered, in per cent; -1 for blocked ones."""
    rows, columns = field.free.shape
    quarters = covered.reshape(rows, 2, columns, 2).sum(axis=(1, 3))
    return _grid(field, np.where(field.free, 25 * quarters, -1), now_ns)


def path_message(waypoints: WaypointProgress, now_ns: int) -> PathMessage:
    """The waypoints of one UAV."""
    stamp = header(now_ns, "map")
    return PathMessage(
        stamp, [PoseStamped(stamp, Pose(Point(*p), _LEVEL)) for p in waypoints.places]
    )


def goal_message(place: NDArray[np.float64], now_ns: int) -> PoseStamped:
    """A goal in the map, the heading left as it is."""
    return PoseStamped(header(now_ns, "map"), Pose(Point(*place.tolist()), KEEP_HEADING))


def status_message(
    flights: Sequence[CoverageFlight], plan: CoveragePlan | None, share: float, refused: str
) -> String:
    """JSON: state, share covered, phase and cells of each UAV, what cannot be done and why."""
    shares = [] if plan is None else plan.shares.tolist()
    told = {
        "state": "refused" if refused else "waiting" if plan is None else "flying",
        "covered": round(share, 4),
        "phases": {flight.name: str(flight.phase) for flight in flights},
        "cells": shares,
        "spread": 0 if plan is None else plan.spread,
        "unreachable": 0 if plan is None else plan.unreachable,
        "reason": refused,
    }
    return String(json.dumps(told))


def _grid(field: CoverageField, values: NDArray[np.generic], now_ns: int) -> OccupancyGrid:
    data = values.astype(np.int8).ravel()
    data.flags.writeable = False
    rows, columns = field.free.shape
    turn = Quaternion(*rotations.from_rpy(0.0, 0.0, field.yaw).tolist())
    place = Pose(Point(*field.origin_map, 0.0), turn)
    info = MapMetaData(time_from_ns(now_ns), single(field.cell_m), columns, rows, place)
    return OccupancyGrid(header(now_ns, "map"), info, data)
