"""The vehicles of a simulation: spawned, deleted, moved and reset while it runs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from volery.comms.radio.network import RadioNetwork
from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.graph.nodes.node import Node
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.sensor_suites import lidar_mounts
from volery.runtime.snapshot_manager import SnapshotManager
from volery.runtime.vehicles.batch_commands import BatchCommands, joined_states
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.manager import VehicleManager
from volery.runtime.vehicles.spawning import Spawner
from volery.runtime.vehicles.teleport import Teleporter
from volery.runtime.vehicles.uav import Uav
from volery.scenario.schema import UavType
from volery.sensors.mount import Mount
from volery.vehicle.fleet import FleetState


class SimulationVehicles(BatchCommands):
    """Changes the fleet of a simulation, commands all its UAVs at once, and describes them.

    check_open: raises `CommandError` once the simulation is closed.
    """

    def __init__(
        self,
        manager: VehicleManager,
        snapshots: SnapshotManager,
        check_open: Callable[[], None],
    ) -> None:
        self._manager = manager
        self._snapshots = snapshots
        self._spawner = Spawner(manager, snapshots)
        self._teleporter = Teleporter(manager)
        self._check_open = check_open

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the UAVs in fleet order."""
        return tuple(self._manager.uavs)

    @property
    def start_poses(self) -> tuple[StartPose, ...]:
        """Initial poses of the UAVs in fleet order."""
        return self._manager.starts

    @property
    def types(self) -> Mapping[str, UavType]:
        """Types of the scenario and of spawned UAVs, by name."""
        return self._manager.scenario.types

    @property
    def spawnable(self) -> tuple[str, ...]:
        """Types that `spawn` takes: the scenario's, and every airframe with the usual sensors."""
        return self._spawner.kinds

    @property
    def spawned(self) -> tuple[str, ...]:
        """Names of the UAVs that were spawned after the start."""
        return tuple(self._snapshots.spawned)

    @property
    def radio(self) -> RadioNetwork | None:
        """Radio network of the UAVs; None: the scenario has none."""
        return self._manager.radio

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Nodes that run inside, in fleet order, then those of the whole system."""
        return tuple(self._manager.nodes)

    @property
    def lidar_mounts(self) -> Mapping[str, Mount]:
        """Mounts of the LIDARs that publish LaserScans, by topic."""
        return lidar_mounts(self._manager.fitted, planar=True)

    @property
    def point_cloud_mounts(self) -> Mapping[str, Mount]:
        """Mounts of the LIDARs that publish PointCloud2s, by topic."""
        return lidar_mounts(self._manager.fitted, planar=False)

    def state(self) -> FleetState:
        """Returns copies of the present states of all UAVs, in fleet order; arrays are (n, ...)."""
        return joined_states([self._manager.engine.fleet.state], self._batch_shape)

    def spawn(
        self,
        name: str,
        kind: str,
        position_map: ArrayLike,
        attitude: ArrayLike = (0.0, 0.0, 0.0, 1.0),
    ) -> Uav:
        """Adds a UAV at (3,) m with (4,) x y z w, map from body, while the others fly on.

        kind: one of `spawnable`. The UAV stands or, in the air, holds; its topics, services,
        sensors and nodes begin now. A position between its feet and the ground counts as on the
        ground. Raises `SpawnError` for a bad name or type, or if a step fails, `PlacementError` for
        an impossible pose; the flight then goes on as before.
        """
        self._check_open()
        return self._spawner.spawn(name, kind, position_map, attitude)

    def delete(self, name: str) -> None:
        """Removes a UAV while the others fly on. Raises `CommandError` for the last one."""
        self._check_open()
        self.row_of(name)
        self._spawner.delete([name])

    def delete_spawned(self) -> None:
        """Removes all UAVs that were spawned after the start."""
        self._check_open()
        self._spawner.delete(self.spawned)

    def set_pose(self, name: str, position_map: ArrayLike, attitude: ArrayLike) -> None:
        """Moves a UAV to (3,) m with (4,) x y z w, map from body.

        A flying UAV holds there; a standing one hovers where the pose is in the air. Raises
        `PlacementError` for an impossible pose.
        """
        self._check_open()
        self._teleporter.teleport(self.row_of(name), position_map, attitude)

    def set_velocity(self, name: str, velocity_map: ArrayLike, omega_map: ArrayLike) -> None:
        """Sets a UAV's velocity, (3,) m/s, and angular velocity, (3,) rad/s, both in the map.

        A flying UAV brakes and holds. Raises `CommandError` for values out of range.
        """
        self._check_open()
        self._teleporter.move(self.row_of(name), velocity_map, omega_map)

    def reset(self, name: str) -> None:
        """Resets one UAV to its start while the others fly on: repaired and charged.

        Its plant, controllers, sensors, estimate and nodes start again, with the noise of the
        start; guidance and sensors keep their phase. Raises `CommandError` where its start is
        occupied.
        """
        self._check_open()
        self._snapshots.reset_uav(self.row_of(name))

    @property
    def _batch_shape(self) -> tuple[int, ...]:
        return (len(self._manager.uavs),)

    def _handles(self) -> Sequence[Uav]:
        self._check_open()
        return tuple(self._manager.uavs.values())

    def _paths(self) -> Sequence[str]:
        return tuple(self._manager.uavs)

    def _fleets(self) -> Sequence[tuple[Fleet, slice]]:
        self._check_open()
        return [(self._manager.engine.fleet, slice(None))]

    def _future_lists(self) -> Sequence[FlightFutures]:
        return [self._manager.futures]

    def _check_accepted(self, command: str, ignoring: Collection[FlightMode]) -> None:
        fleet = self._manager.engine.fleet
        if not np.isin(fleet.modes, list(ignoring)).all():
            return
        modes = ", ".join(
            f"{name} is {fleet.mode(i).name}" for i, name in enumerate(self.names[:3])
        )
        more = f" and {len(self.names) - 3} more" if len(self.names) > 3 else ""
        raise CommandError(f"{command} reaches no UAV: {modes}{more}; take off and wait() first")

    def __len__(self) -> int:
        """Number of UAVs."""
        return len(self._manager.uavs)

    def __getitem__(self, key: object) -> NoReturn:
        """Raises `CommandError`: single UAVs are in `Simulation.uavs`."""
        raise CommandError(
            "simulation.vehicles commands all UAVs; simulation.uavs has each by its name: "
            "simulation.uavs['uav1'], or [uav.hold() for uav in list(simulation.uavs.values())[:2]]"
        )

    def __repr__(self) -> str:
        uavs = self._manager.uavs.values()
        modes = [f"{uav.name} {uav.mode.name}" for uav in list(uavs)[:6]]
        if len(uavs) > 6:
            modes.append(f"{len(uavs) - 6} more")
        return f"<{counted(len(uavs), 'UAV')}: {', '.join(modes)}>"

    def row_of(self, name: str) -> int:
        """Returns a UAV's row in fleet arrays. Raises `CommandError` for an unknown name."""
        if name not in self._manager.uavs:
            raise CommandError(f"there is no UAV '{name}'; known: {', '.join(self._manager.uavs)}")
        return self.names.index(name)
