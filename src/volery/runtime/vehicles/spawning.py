"""Spawns and deletes UAVs while the simulation runs."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from volery.control.setpoints import checked_attitude
from volery.core.errors import (
    CommandError,
    DataFileError,
    PlacementError,
    ScenarioError,
    SpawnError,
    SpawnFault,
    VoleryError,
)
from volery.runtime.construction.placement import (
    StartPose,
    check_position,
    landed_pose,
    stands_on_ground,
)
from volery.runtime.snapshot_manager import SnapshotManager
from volery.runtime.vehicles.manager import VehicleManager
from volery.runtime.vehicles.teleport import near
from volery.runtime.vehicles.uav import Uav
from volery.scenario.schema import (
    BatterySensor,
    GroundTruthSensor,
    ImuSensor,
    OdometrySensor,
    Sensor,
    UavType,
)
from volery.vehicle.airframe import Airframe, airframe_names, load_airframe

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_RESERVED = (
    "volery",
    "tf",
    "tf_static",
    "clock",
    "events",
    "rosapi",
    "map",
    "map_command",
    "actors",
)
"""Other names at the root of the graph."""


class Spawner:
    """Adds UAVs to a fleet and removes them."""

    def __init__(self, manager: VehicleManager, snapshots: SnapshotManager) -> None:
        self._manager = manager
        self._snapshots = snapshots
        self._scene = manager.engine.scene
        self._terrain = manager.terrain

    @property
    def kinds(self) -> tuple[str, ...]:
        """Types that can be spawned: scenario types, and airframes with the usual sensors."""
        types = self._manager.scenario.types
        return (*types, *(name for name in airframe_names() if name not in types))

    def spawn(self, name: str, kind: str, position_map: ArrayLike, attitude: ArrayLike) -> Uav:
        """Adds a UAV; see `SimulationVehicles.spawn` for arguments and errors."""
        self._check_name(name)
        airframe = self._airframe_of(kind)
        start = self._start(name, kind, airframe, position_map, attitude)
        try:
            undo = self._manager.regroup((*self._manager.starts, start))
            try:
                self._manager.start_nodes()
                self._snapshots.enlist(name)
            except Exception:
                undo()
                raise
        except (CommandError, ScenarioError, DataFileError):
            raise
        except Exception as error:
            reason = f"{name} was not spawned: {_text_of(error)}"
            raise SpawnError(SpawnFault.FAILED, reason) from error
        return self._manager.uavs[name]

    def delete(self, names: Collection[str]) -> None:
        """Removes UAVs; raises `CommandError` if none would be left, or if that fails."""
        if not names:
            return
        left = [start for start in self._manager.starts if start.name not in names]
        try:
            self._manager.regroup(left)
        except VoleryError:
            raise
        except Exception as error:
            reason = f"{', '.join(names)} not deleted: {_text_of(error)}"
            raise CommandError(reason) from error

    def _check_name(self, name: str) -> None:
        if not _NAME.fullmatch(name) or name in _RESERVED:
            raise SpawnError(
                SpawnFault.NAME,
                f"'{name}' is no name for a UAV: up to 40 of a-z, 0-9 and _, a letter first, and "
                f"none of {', '.join(_RESERVED)}",
            )
        if name in self._manager.uavs:
            raise SpawnError(SpawnFault.NAME_TAKEN, f"there is a UAV '{name}' already")
        actors = self._scene.actors
        if actors is not None and name in actors.names:
            raise SpawnError(SpawnFault.NAME_TAKEN, f"there is an actor '{name}' already")

    def _airframe_of(self, kind: str) -> Airframe:
        if kind not in self.kinds:
            known = ", ".join(self.kinds)
            raise SpawnError(SpawnFault.TYPE, f"there is no UAV type '{kind}'; known: {known}")
        scenario = self._manager.scenario
        if kind not in scenario.types:
            types = {**scenario.types, kind: usual_type(load_airframe(kind))}
            self._manager.scenario = scenario = scenario.model_copy(update={"types": types})
        return load_airframe(scenario.access.find_model(scenario.types[kind].airframe))

    def _start(
        self,
        name: str,
        kind: str,
        airframe: Airframe,
        position_map: ArrayLike,
        attitude: ArrayLike,
    ) -> StartPose:
        position = np.asarray(position_map, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise PlacementError(f"a position is three finite numbers, not {position_map!r}")
        try:
            turn = checked_attitude(attitude)
        except CommandError as error:
            raise PlacementError(str(error)) from None
        slides = self._manager.scenario.types[kind].plant != "kinematic"
        position, turn, at_rest = landed_pose(
            position, turn, airframe, self._terrain, name, slides=slides
        )
        others = near(self._manager.starts, self._manager.engine.fleet.state.position_map, position)
        check_position(
            position, airframe, self._scene, self._terrain, others, name, at_rest=at_rest
        )
        stands = at_rest or stands_on_ground(position, airframe, self._terrain)
        return StartPose(
            name,
            kind,
            airframe,
            position,
            turn,
            on_ground=stands,
            takes_off=False,
            at_rest=at_rest,
        )


def usual_type(airframe: Airframe) -> UavType:
    """Returns a type for an airframe without one: with IMU, odometry and ground truth."""
    sensors: list[Sensor] = [
        ImuSensor(kind="imu"),
        OdometrySensor(kind="odometry"),
        GroundTruthSensor(kind="ground_truth"),
    ]
    if airframe.battery is not None:
        sensors.append(BatterySensor(kind="battery"))
    return UavType(airframe=airframe.name, sensors=tuple(sensors))


def _text_of(error: Exception) -> str:
    return str(error) if isinstance(error, VoleryError) else f"{type(error).__name__}: {error}"
