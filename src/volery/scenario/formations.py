"""Formations: groups of UAVs for a scenario's `uavs`, at many positions."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from volery.core.errors import ScenarioError
from volery.scenario.schema import UavGroup

OnStart = Literal["wait", "take_off"]


def at_positions(
    type: str,
    position_m: ArrayLike,
    *,
    yaw_deg: ArrayLike = 0.0,
    on_start: OnStart = "take_off",
) -> tuple[UavGroup, ...]:
    """Returns a group for each position: one UAV of the scenario's type `type`.

    position_m: (N, 2) m, on the ground, or (N, 3) m, in the map. yaw_deg: (N,) or one for all,
    degrees, counter-clockwise from x. Raises `ScenarioError` for other shapes.
    """
    positions = _positions(position_m)
    try:
        yaws = np.broadcast_to(np.asarray(yaw_deg, dtype=np.float64), len(positions))
    except ValueError:
        raise ScenarioError(
            f"yaw_deg has shape {np.shape(yaw_deg)}; give one number or {len(positions)}"
        ) from None
    return tuple(
        UavGroup(type=type, position_m=tuple(position), yaw_deg=yaw, on_start=on_start)
        for position, yaw in zip(positions.tolist(), yaws.tolist(), strict=True)
    )


def circle(
    type: str,
    count: int,
    *,
    radius_m: float,
    centre_m: ArrayLike = (0.0, 0.0),
    heading: Literal["out", "in", "along"] = "out",
    on_start: OnStart = "take_off",
) -> tuple[UavGroup, ...]:
    """Returns `count` UAVs of the scenario's type `type`, evenly spaced on a circle.

    The first is at +x, the others follow counter-clockwise. centre_m: (2,) m, on the ground, or
    (3,) m, in the map. heading: away from the centre, towards it, or along the circle. Raises
    `ScenarioError` for a count below 1 or another shape.
    """
    if count < 1:
        raise ScenarioError(f"a circle needs at least 1 UAV (found {count})")
    centre = _positions([centre_m])[0]
    angle = np.arange(count) * (2.0 * math.pi / count)
    positions = np.tile(centre, (count, 1))
    positions[:, 0] += radius_m * np.cos(angle)
    positions[:, 1] += radius_m * np.sin(angle)
    turn_deg = {"out": 0.0, "in": 180.0, "along": 90.0}[heading]
    yaw_deg = (np.degrees(angle) + turn_deg + 180.0) % 360.0 - 180.0
    return at_positions(type, positions.round(6), yaw_deg=yaw_deg.round(6), on_start=on_start)


def grid(
    type: str,
    rows: int,
    columns: int,
    *,
    spacing_m: float,
    corner_m: ArrayLike = (0.0, 0.0),
    on_start: OnStart = "take_off",
) -> tuple[UavGroup, ...]:
    """Returns `rows` times `columns` UAVs of the scenario's type `type`, row by row.

    Rows follow each other along y, the UAVs of a row along x. corner_m: position of the first UAV,
    (2,) m, on the ground, or (3,) m, in the map. Raises `ScenarioError` for less than one row or
    column, or another shape.
    """
    if rows < 1 or columns < 1:
        raise ScenarioError(f"a grid needs rows and columns (found {rows} x {columns})")
    positions = np.tile(_positions([corner_m])[0], (rows * columns, 1))
    positions[:, 0] += spacing_m * (np.arange(rows * columns) % columns)
    positions[:, 1] += spacing_m * (np.arange(rows * columns) // columns)
    return at_positions(type, positions.round(6), on_start=on_start)


def _positions(position_m: Any) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    try:
        positions = np.asarray(position_m, dtype=np.float64)
    except (TypeError, ValueError):
        raise ScenarioError("positions are numbers of shape (N, 2) or (N, 3), m") from None
    if positions.ndim != 2 or positions.shape[1] not in (2, 3) or not len(positions):
        raise ScenarioError(f"positions have shape (N, 2) or (N, 3), not {positions.shape}")
    return positions
