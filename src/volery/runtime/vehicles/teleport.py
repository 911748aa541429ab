"""Teleports UAVs while the simulation runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from volery.control.flight_modes import FlightMode
from volery.control.setpoints import checked_attitude
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import CommandError, PlacementError
from volery.runtime.construction.placement import (
    StartPose,
    check_position,
    landed_pose,
    raised,
    stands_on_ground,
)
from volery.runtime.vehicles.manager import VehicleManager
from volery.vehicle.kinematic import Kinematic

_NEAR_RADIUS_M = 10.0
"""Larger than the distance at which any two UAVs touch, m."""


class Teleporter:
    """Teleports UAVs of an engine to free positions."""

    def __init__(self, manager: VehicleManager) -> None:
        self._manager = manager
        self._engine = manager.engine
        self._scene = manager.engine.scene
        self._terrain = manager.terrain

    def teleport(self, row: int, position_map: ArrayLike, attitude: ArrayLike) -> None:
        """Teleports UAV `row` to (3,), m, and (4,), x y z w, map from body; its velocity continues.

        A flying UAV holds there; a landed one hovers if the position is in the air, and rests on
        the ground if it is between its feet and the ground. Its estimate
        restarts. Raises `PlacementError` with the reason if the pose is not possible.
        """
        position = np.asarray(position_map, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise PlacementError(f"a position is three finite numbers, not {position_map!r}")
        fleet, start = self._engine.fleet, self._manager.starts[row]
        try:
            turn, at_rest = checked_attitude(attitude), False
            if fleet.mode(row) is FlightMode.LANDED:
                slides = not isinstance(fleet.plants[row], Kinematic)
                position, turn, at_rest = landed_pose(
                    position, turn, start.airframe, self._terrain, start.name, slides=slides
                )
            else:
                position = raised(position, start.airframe, self._terrain)
            self._check(row, position, at_rest)
            stands = at_rest or stands_on_ground(position, start.airframe, self._terrain)
            fleet.put(row, position, turn, in_air=not stands)
            if at_rest:
                fleet.rest(row)
        except CommandError as error:
            raise PlacementError(str(error)) from None
        self._engine.collisions.forget(np.array([row]))
        streams = {f.id.uav: f.key for f in self._manager.fitted if f.id.name == "odom"}
        if self._engine.estimation is not None and row in streams:
            self._engine.estimation.restart({row: streams[row]})

    def move(self, row: int, velocity_map: ArrayLike, omega_map: ArrayLike) -> None:
        """Sets the velocity (3,), m/s, and rate (3,), rad/s, of UAV `row`, both in the map frame.

        Its controllers continue from there. Raises `CommandError` if the values are not possible.
        """
        attitude = self._engine.fleet.state.attitude[row]
        omega_body = rotations.rotate(rotations.conjugate(attitude), np.asarray(omega_map))
        self._engine.fleet.push(row, velocity_map, omega_body)

    def _check(self, row: int, position: Array, at_rest: bool) -> None:
        start = self._manager.starts[row]
        present = self._engine.fleet.state.position_map
        around = near(self._manager.starts, present, position)
        others = [other for other in around if other.name != start.name]
        scene, terrain = self._scene, self._terrain
        check_position(
            position, start.airframe, scene, terrain, others, start.name, at_rest=at_rest
        )


def near(starts: Sequence[StartPose], present: Array, position: Array) -> list[StartPose]:
    """Returns the UAVs within 10 m of `position` (3,), m, moved to their `present` (N, 3), m."""
    rows = np.flatnonzero(np.linalg.norm(present - position, axis=1) < _NEAR_RADIUS_M).tolist()
    return [replace(starts[row], position_map=present[row]) for row in rows]
