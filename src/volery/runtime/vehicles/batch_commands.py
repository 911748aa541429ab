"""Commands to all UAVs of a simulation, or of all its environments, as arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.control.trajectory import Trajectory
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.runtime.vehicles.flight_future import FlightFuture
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.uav import Uav
from volery.vehicle.fleet import FleetState

_NOT_GUIDED = (FlightMode.LANDED, FlightMode.TAKE_OFF, FlightMode.CRASHED)


class BatchCommands(ABC):
    """Commands with the names of `Uav`'s, for all UAVs at once.

    Arrays have the shape (n, ...) of the UAVs in fleet order, or (K, n, ...) in K environments, and
    broadcast to it. Commands act from the next physics step. Crashed UAVs ignore all of them; UAVs
    on the ground and taking off ignore those that guide a flight (velocity, acceleration, setpoint,
    position, trajectory). Raises `CommandError`, and changes nothing, for numbers that do not
    broadcast, are not finite or are out of range, and for plants that lack a command.
    """

    # ------------------------------------------------------------------------------ flight modes

    def take_off(self, altitude_m: float | None = None) -> list[FlightFuture]:
        """Takes off with all UAVs on the ground; returns their futures, for `run_until`."""
        modes = (FlightMode.LANDED,)
        return [uav.take_off(altitude_m) for uav in self._handles() if uav.mode in modes]

    def hold(self) -> list[FlightFuture]:
        """Stops all flying UAVs, which then hold; returns their futures."""
        return [uav.hold() for uav in self._flying()]

    def land(self) -> list[FlightFuture]:
        """Lands all flying UAVs; returns their futures."""
        return [uav.land() for uav in self._flying()]

    def go_to(self, position_map: ArrayLike, yaw: ArrayLike | None = None) -> list[FlightFuture]:
        """Flies to positions (n, 3), m, in the map frame, with headings `yaw` (n,), rad.

        Returns the futures of the UAVs that fly. Raises `CommandError` at the first position that
        is below the ground or inside an obstacle: UAVs before it in fleet order fly already.
        """
        goals = self._flat("position", position_map, (3,))
        yaws = self._yaws(yaw)
        return [uav.go_to(goals[i], yaws[i]) for i, uav in self._guided()]

    def follow_trajectory(
        self, trajectories: Trajectory | Sequence[Trajectory]
    ) -> list[FlightFuture]:
        """Flies along trajectories, one for all UAVs or one for each; returns their futures."""
        handles = self._handles()
        several = (
            [trajectories] * len(handles) if isinstance(trajectories, Trajectory) else trajectories
        )
        if len(several) != len(handles):
            raise CommandError(
                f"{len(several)} trajectories for {len(handles)} UAVs; give one each"
            )
        return [uav.follow_trajectory(several[i]) for i, uav in self._guided()]

    # ------------------------------------------------------------------------ lower-level commands

    def command_velocity(self, velocity: ArrayLike, yaw_rate: ArrayLike = 0.0) -> None:
        """Flies at `velocity` (n, 3), m/s, in level heading frames (FLU), `yaw_rate` (n,) rad/s."""
        velocities, rates = self._flat("velocity", velocity, (3,)), self._flat("yaw_rate", yaw_rate)
        for fleet, rows in self._fleets():
            fleet.command_velocities(velocities[rows], rates[rows])
        self._check_futures()

    def command_velocity_map(
        self, velocity: ArrayLike, yaw_rate: ArrayLike = 0.0, *, yaw: ArrayLike | None = None
    ) -> None:
        """Flies at `velocity` (n, 3), m/s, in the map; `yaw_rate` (n,) rad/s or `yaw` (n,) rad."""
        velocities, rates = self._flat("velocity", velocity, (3,)), self._flat("yaw_rate", yaw_rate)
        yaws = self._yaws(yaw)
        for i, uav in self._guided():
            uav.command_velocity_map(velocities[i], float(rates[i]), yaw=yaws[i])

    def command_acceleration(
        self, acceleration_map: ArrayLike, yaw: ArrayLike | None = None, yaw_rate: ArrayLike = 0.0
    ) -> None:
        """Accelerates by (n, 3), m/s^2, in the map frame at `yaw` (n,), rad (None: unchanged)."""
        accelerations = self._flat("acceleration", acceleration_map, (3,))
        yaws, rates = self._yaws(yaw), self._flat("yaw_rate", yaw_rate)
        for i, uav in self._guided():
            uav.command_acceleration(accelerations[i], yaws[i], float(rates[i]))

    def command_setpoint(
        self,
        position_map: ArrayLike,
        velocity_map: ArrayLike = (0.0, 0.0, 0.0),
        acceleration_map: ArrayLike = (0.0, 0.0, 0.0),
        yaw: ArrayLike | None = None,
        yaw_rate: ArrayLike = 0.0,
    ) -> None:
        """Commands points of trajectories: positions (n, 3) m, velocities, accelerations, map."""
        positions = self._flat("position", position_map, (3,))
        velocities = self._flat("velocity", velocity_map, (3,))
        accelerations = self._flat("acceleration", acceleration_map, (3,))
        yaws, rates = self._yaws(yaw), self._flat("yaw_rate", yaw_rate)
        for i, uav in self._guided():
            uav.command_setpoint(
                positions[i], velocities[i], accelerations[i], yaws[i], float(rates[i])
            )

    def command_attitude(self, attitude: ArrayLike, thrust: ArrayLike) -> None:
        """Holds attitudes (n, 4), x y z w, with thrusts (n,), N, along the bodies' z axes."""
        attitudes, thrusts = self._flat("attitude", attitude, (4,)), self._flat("thrust", thrust)
        for fleet, rows in self._fleets():
            fleet.command_all_attitudes(attitudes[rows], thrusts[rows])
        self._check_futures()

    def command_rates(self, omega_body: ArrayLike, thrust: ArrayLike) -> None:
        """Turns at `omega_body` (n, 3), rad/s, with thrusts (n,), N, along the bodies' z axes."""
        rates, thrusts = self._flat("rates", omega_body, (3,)), self._flat("thrust", thrust)
        for fleet, rows in self._fleets():
            fleet.command_all_rates(rates[rows], thrusts[rows])
        self._check_futures()

    def command_rotor_speeds(self, speeds: ArrayLike) -> None:
        """Turns the rotors at `speeds` (n, R), rad/s; R is the largest number of rotors.

        Columns beyond a UAV's rotors are ignored.
        """
        fleets = self._fleets()
        airframes = [airframe for fleet, _ in fleets for airframe in fleet.airframes]
        rotors = max(len(airframe.rotors.places) for airframe in airframes)
        targets = self._flat("rotor speeds", speeds, (rotors,))
        for fleet, rows in fleets:
            fleet.command_all_rotor_speeds(targets[rows])
        self._check_futures()

    # -------------------------------------------------------------------------------- the fleets

    @property
    @abstractmethod
    def _batch_shape(self) -> tuple[int, ...]:
        """Shape of the UAVs: (n,) or (K, n)."""

    @abstractmethod
    def _handles(self) -> Sequence[Uav]:
        """Returns the handles of all UAVs, in the order of the flattened arrays."""

    @abstractmethod
    def _fleets(self) -> Sequence[tuple[Fleet, slice]]:
        """Returns the fleets with their parts of the flattened arrays."""

    @abstractmethod
    def _future_lists(self) -> Sequence[FlightFutures]:
        """Returns the futures of the UAVs' flight commands."""

    # ------------------------------------------------------------------------------------ inside

    def _flying(self) -> list[Uav]:
        down = (FlightMode.LANDED, FlightMode.CRASHED)
        return [uav for uav in self._handles() if uav.mode not in down]

    def _guided(self) -> list[tuple[int, Uav]]:
        """Returns the UAVs that guided commands reach, with their rows."""
        return [(i, uav) for i, uav in enumerate(self._handles()) if uav.mode not in _NOT_GUIDED]

    def _check_futures(self) -> None:
        for futures in self._future_lists():
            futures.check_all()

    def _yaws(self, yaw: ArrayLike | None) -> Sequence[float | None]:
        if yaw is None:
            return [None] * int(np.prod(self._batch_shape))
        yaws: list[float | None] = self._flat("yaw", yaw).tolist()
        return yaws

    def _flat(self, what: str, values: ArrayLike, tail: tuple[int, ...] = ()) -> Array:
        """Broadcasts finite numbers to all UAVs and flattens them to (N, ...)."""
        shape = (*self._batch_shape, *tail)
        try:
            spread = np.broadcast_to(np.asarray(values, dtype=np.float64), shape)
        except (TypeError, ValueError):
            raise CommandError(f"{what}: numbers that broadcast to {shape} are needed") from None
        if not np.isfinite(spread).all():
            raise CommandError(f"{what} must be finite")
        return spread.reshape(-1, *tail)


def joined_states(states: Sequence[FleetState], shape: tuple[int, ...]) -> FleetState:
    """Returns copies of the states of fleets as one, its arrays in `shape` (n,) or (K, n)."""

    def join(arrays: tuple[NDArray[np.generic], ...]) -> NDArray[np.generic]:
        return np.concatenate(arrays).reshape(*shape, *arrays[0].shape[1:])

    return FleetState(*(join(arrays) for arrays in zip(*states, strict=True)))  # type: ignore[arg-type]
