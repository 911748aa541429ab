"""Commands to all UAVs of a simulation, or of all its environments, as arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.batch_limits import BatchLimits
from volery.control.fleet import Fleet
from volery.control.flight_modes import DOWN_MODES, FlightMode
from volery.control.setpoints import ControlLevel
from volery.control.trajectory import Trajectory
from volery.core.arrays import Array
from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.core.uncopied import Uncopied
from volery.runtime.checks import check_timeout
from volery.runtime.vehicles.flight_future import CommandResult, FlightFuture
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.uav import Uav
from volery.vehicle.fleet import FleetState


class FlightFutureList(list[FlightFuture]):
    """Futures of one command to several UAVs: `vehicles.take_off().wait()`, or `await` it.

    now_s: returns the simulated time, s.
    """

    def __init__(self, futures: Iterable[FlightFuture], now_s: Callable[[], float]) -> None:
        super().__init__(futures)
        self._now_s = now_s

    def wait(self, timeout_s: float = 60.0) -> list[CommandResult]:
        """Waits for all of them, `timeout_s` of simulated time, s, together.

        Returns their results. See `FlightFuture.wait`.
        """
        end_s = self._now_s() + timeout_s
        for future in self:
            if not future.wait_until_done(max(0.0, end_s - self._now_s())):
                raise future.timeout_error(timeout_s)
        return [future.result() for future in self]

    def __await__(self) -> Generator[Any, None, list[CommandResult]]:
        """Waits for all of them while other coroutines run; see `FlightFuture`."""
        results = []
        for future in self:
            results.append((yield from future.__await__()))
        return results


_NOT_GUIDED = (FlightMode.LANDED, FlightMode.TAKE_OFF, FlightMode.CRASHED)
_NOT_LOW_LEVEL = (FlightMode.CRASHED,)


class BatchCommands(Uncopied, ABC):
    """Commands with the names of `Uav`'s, for all UAVs at once.

    Arrays have the shape (n, ...) of the UAVs in fleet order, or (K, n, ...) in K environments, and
    broadcast to it. Commands act from the next physics step. Crashed UAVs ignore all of them; UAVs
    on the ground ignore those that guide a flight, and during a take-off those that stream
    (velocity, acceleration, setpoint). Raises `CommandError`, and changes nothing, for numbers that
    do not broadcast, are not finite or are out of range, for plants that lack a command, and for a
    flight mode that no UAV accepts, with the reason of the first one.
    """

    _checked_fleets: tuple[Fleet, ...] = ()
    _limits: BatchLimits | None = None

    # ------------------------------------------------------------------------------ flight modes

    def take_off(self, altitude_m: float | None = None) -> FlightFutureList:
        """Takes off with all UAVs on the ground, by `altitude_m`, m; returns their futures."""
        landed = [uav for uav in self._handles() if uav.mode is FlightMode.LANDED]
        return self._begin_all("take_off", landed, lambda uav: uav.take_off(altitude_m))

    def hold(self) -> FlightFutureList:
        """Stops all flying UAVs, which then hold; returns their futures."""
        return self._begin_all("hold", self._flying(), lambda uav: uav.hold())

    def land(self) -> FlightFutureList:
        """Lands all flying UAVs; returns their futures."""
        return self._begin_all("land", self._flying(), lambda uav: uav.land())

    def return_home(self) -> FlightFutureList:
        """Returns all flying UAVs to their take-off positions; returns their futures."""
        return self._begin_all("return_home", self._flying(), lambda uav: uav.return_home())

    def wait(self, timeout_s: float = 60.0) -> list[CommandResult]:
        """Waits for the present flight commands of all UAVs, such as the take-off at the start.

        Returns the results of the UAVs that had a command to complete. `timeout_s` is simulated
        time, s, for all together. See `Uav.wait`. Raises `CommandError` if all UAVs have crashed.
        """
        check_timeout(timeout_s)
        if self._handles() and all(uav.crashed for uav in self._handles()):
            raise CommandError("all UAVs have crashed: there is nothing to wait for")
        pending = [future for uav in self._handles() if (future := uav.pending_command)]
        return FlightFutureList(pending, self._now_s).wait(timeout_s)

    def go_to(self, position_map: ArrayLike, yaw: ArrayLike | None = None) -> FlightFutureList:
        """Flies to positions (n, 3), m, in the map frame, with headings `yaw` (n,), rad.

        Returns the futures of the UAVs that fly. Raises `CommandError` at the first position that
        is below the ground or inside an obstacle: UAVs before it in fleet order fly already.
        """
        limits = self._find_limits()
        goals = limits.positions(self._flat("position", position_map, (3,)))
        yaws = self._flat_yaw(yaw)
        rows = {uav: i for i, uav in enumerate(self._handles())}

        def go(uav: Uav) -> FlightFuture:
            return uav.go_to(goals[rows[uav]], None if yaws is None else float(yaws[rows[uav]]))

        return self._begin_all("go_to", self._flying(), go)

    def follow_trajectory(
        self, trajectories: Trajectory | Iterable[Trajectory]
    ) -> FlightFutureList:
        """Flies along trajectories, one for all UAVs or one for each; returns their futures."""
        handles = self._handles()
        several = (
            [trajectories] * len(handles)
            if isinstance(trajectories, Trajectory)
            else list(trajectories)
        )
        if len(several) != len(handles):
            raise CommandError(
                f"{len(several)} trajectories for {len(handles)} UAVs; give one each"
            )
        own = dict(zip(handles, several, strict=True))
        return self._begin_all(
            "follow_trajectory", self._flying(), lambda uav: uav.follow_trajectory(own[uav])
        )

    # ------------------------------------------------------------------------ lower-level commands

    def command_velocity(self, velocity: ArrayLike, yaw_rate: ArrayLike = 0.0) -> None:
        """Flies at `velocity` (n, 3), m/s, in level heading frames (FLU), `yaw_rate` (n,) rad/s."""
        limits = self._find_limits()
        velocities = limits.velocities(self._flat("velocity", velocity, (3,)))
        rates = limits.yaw_rates(self._flat("yaw rate", yaw_rate))
        self._check_accepted("command_velocity", _NOT_GUIDED)
        for fleet, rows in self._fleets():
            fleet.command_velocities(velocities[rows], rates[rows])
        self._replace_futures("command_velocity", FlightMode.VELOCITY)

    def command_velocity_map(
        self, velocity: ArrayLike, yaw_rate: ArrayLike = 0.0, *, yaw: ArrayLike | None = None
    ) -> None:
        """Flies at `velocity` (n, 3), m/s, in the map; `yaw_rate` (n,) rad/s or `yaw` (n,) rad."""
        limits = self._find_limits()
        velocities = limits.velocities(self._flat("velocity", velocity, (3,)))
        rates, yaws = limits.yaw_rates(self._flat("yaw rate", yaw_rate)), self._flat_yaw(yaw)
        self._check_accepted("command_velocity_map", _NOT_GUIDED)
        for fleet, rows in self._fleets():
            fleet.command_map_velocities(velocities[rows], _of(yaws, rows), rates[rows])
        self._replace_futures("command_velocity_map", FlightMode.VELOCITY)

    def command_acceleration(
        self, acceleration_map: ArrayLike, yaw: ArrayLike | None = None, yaw_rate: ArrayLike = 0.0
    ) -> None:
        """Accelerates by (n, 3), m/s^2, in the map frame at `yaw` (n,), rad (None: unchanged)."""
        limits = self._find_limits()
        accelerations = limits.accelerations(self._flat("acceleration", acceleration_map, (3,)))
        rates, yaws = limits.yaw_rates(self._flat("yaw rate", yaw_rate)), self._flat_yaw(yaw)
        self._check_accepted("command_acceleration", _NOT_GUIDED)
        for i, uav in self._guided():
            angle = None if yaws is None else float(yaws[i])
            uav.command_acceleration(accelerations[i], angle, float(rates[i]))

    def command_setpoint(
        self,
        position_map: ArrayLike,
        velocity_map: ArrayLike = (0.0, 0.0, 0.0),
        acceleration_map: ArrayLike = (0.0, 0.0, 0.0),
        yaw: ArrayLike | None = None,
        yaw_rate: ArrayLike = 0.0,
    ) -> None:
        """Commands points of trajectories (n, 3): positions m, velocities m/s, accelerations m/s^2.

        In the map frame, with headings `yaw` (n,), rad (None: unchanged), that turn at `yaw_rate`
        (n,), rad/s.
        """
        limits = self._find_limits()
        setpoints = {
            "position_target": limits.positions(self._flat("position", position_map, (3,))),
            "velocity_target": limits.velocities(self._flat("velocity", velocity_map, (3,))),
            "acceleration_target": limits.accelerations(
                self._flat("acceleration", acceleration_map, (3,))
            ),
        }
        rates, yaws = limits.yaw_rates(self._flat("yaw rate", yaw_rate)), self._flat_yaw(yaw)
        self._check_accepted("command_setpoint", _NOT_GUIDED)
        for fleet, rows in self._fleets():
            own = {name: values[rows] for name, values in setpoints.items()}
            fleet.command_setpoints(own, _of(yaws, rows), rates[rows])
        self._replace_futures("command_setpoint", FlightMode.TRAJECTORY)

    def command_attitude(self, attitude: ArrayLike, thrust: ArrayLike) -> None:
        """Holds attitudes (n, 4), x y z w, with thrusts (n,), N, along the bodies' z axes."""
        limits = self._find_limits()
        attitudes = limits.attitudes(self._flat("attitude", attitude, (4,)))
        thrusts = limits.thrusts(self._flat("thrust", thrust))
        setpoints: dict[str, Array | float] = {
            "attitude": attitudes,
            "thrust": thrusts,
            "yaw_rate": 0.0,
        }
        self._command_all("command_attitude", ControlLevel.ATTITUDE, setpoints)

    def command_rates(self, omega_body: ArrayLike, thrust: ArrayLike) -> None:
        """Turns at `omega_body` (n, 3), rad/s, with thrusts (n,), N, along the bodies' z axes."""
        limits = self._find_limits()
        rates = limits.rates(self._flat("rates", omega_body, (3,)))
        thrusts = limits.thrusts(self._flat("thrust", thrust))
        self._command_all("command_rates", ControlLevel.RATES, {"rates": rates, "thrust": thrusts})

    def command_rotor_speeds(self, speeds: ArrayLike) -> None:
        """Turns the rotors at `speeds` (n, R), rad/s; R is the largest number of rotors.

        Columns beyond a UAV's rotors are ignored.
        """
        limits = self._find_limits()
        targets = limits.rotor_speeds(self._flat("rotor speeds", speeds, (limits.num_rotors,)))
        self._command_all("command_rotor_speeds", ControlLevel.ROTORS, {"rotor_target": targets})

    # -------------------------------------------------------------------------------- the fleets

    @property
    @abstractmethod
    def _batch_shape(self) -> tuple[int, ...]:
        """Shape of the UAVs: (n,) or (K, n)."""

    @abstractmethod
    def _handles(self) -> Sequence[Uav]:
        """Returns the handles of all UAVs, in the order of the flattened arrays."""

    @abstractmethod
    def _paths(self) -> Sequence[str]:
        """Returns the names of all UAVs, in the order of the flattened arrays, for errors."""

    @abstractmethod
    def _fleets(self) -> Sequence[tuple[Fleet, slice]]:
        """Returns the fleets with their parts of the flattened arrays."""

    @abstractmethod
    def _future_lists(self) -> Sequence[FlightFutures]:
        """Returns the futures of the UAVs' flight commands."""

    # ------------------------------------------------------------------------------------ inside

    def _flying(self) -> list[Uav]:
        return [uav for uav in self._handles() if uav.mode not in DOWN_MODES]

    def _begin_all(
        self, command: str, uavs: Sequence[Uav], begin: Callable[[Uav], FlightFuture]
    ) -> FlightFutureList:
        """Begins a flight mode of `uavs`, which accept it; raises `CommandError` without any."""
        if not uavs and self._handles():
            try:
                begin(self._handles()[0])  # it refuses, and says why
            except CommandError as error:
                has_pending = any(uav.pending_command for uav in self._handles())
                advice = "; wait() waits for their present commands" if has_pending else ""
                raise CommandError(f"{command} reaches no UAV: {error}{advice}") from None
        return FlightFutureList([begin(uav) for uav in uavs], self._now_s)

    def _now_s(self) -> float:
        return s_from_ns(self._fleets()[0][0].time_ns)

    def _check_accepted(self, command: str, ignoring: Collection[FlightMode]) -> None:
        """Refuses a streamed command if all UAVs are in `ignoring` modes; environments do not."""

    def _guided(self) -> list[tuple[int, Uav]]:
        """Returns the UAVs that guided commands reach, with their rows."""
        return [(i, uav) for i, uav in enumerate(self._handles()) if uav.mode not in _NOT_GUIDED]

    def _replace_futures(self, command: str, mode: FlightMode) -> None:
        for futures in self._future_lists():
            futures.replace_all(command, mode)

    def _command_all(
        self, command: str, level: ControlLevel, setpoints: Mapping[str, Array | float]
    ) -> None:
        self._check_accepted(command, _NOT_LOW_LEVEL)
        for fleet, rows in self._fleets():
            own = {
                name: values[rows] if isinstance(values, np.ndarray) else values
                for name, values in setpoints.items()
            }
            fleet.command_all(level, own)
        self._replace_futures(command, FlightMode.LOW_LEVEL)

    def _find_limits(self) -> BatchLimits:
        """Returns the limits of all UAVs; computes them again when the fleets have changed."""
        fleets = tuple(fleet for fleet, _ in self._fleets())
        if self._limits is None or any(
            one is not other for one, other in zip_longest(fleets, self._checked_fleets)
        ):
            airframes = [airframe for fleet in fleets for airframe in fleet.airframes]
            plants = [plant for fleet in fleets for plant in fleet.plants]
            self._limits = BatchLimits(airframes, plants, self._paths())
            self._checked_fleets = fleets
        return self._limits

    def _flat_yaw(self, yaw: ArrayLike | None) -> Array | None:
        """Returns headings (N,), rad, or None."""
        return None if yaw is None else self._find_limits().yaws(self._flat("yaw", yaw))

    def _flat(self, what: str, values: ArrayLike, tail: tuple[int, ...] = ()) -> Array:
        """Broadcasts numbers to all UAVs and flattens them to (N, ...)."""
        shape = (*self._batch_shape, *tail)
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise CommandError(f"{what}: numbers of shape {shape} are needed") from None
        if array.shape != shape:
            try:
                array = np.broadcast_to(array, shape)
            except ValueError:
                raise CommandError(
                    f"{what} of shape {array.shape} does not broadcast to {shape}"
                ) from None
        return array.reshape(-1, *tail)


def _of(yaws: Array | None, rows: slice) -> Array | None:
    return None if yaws is None else yaws[rows]


def joined_states(states: Sequence[FleetState], shape: tuple[int, ...]) -> FleetState:
    """Returns copies of the states of fleets as one, its arrays in `shape` (n,) or (K, n)."""
    return FleetState(*(_joined(arrays, shape) for arrays in zip(*states, strict=True)))  # type: ignore[arg-type]


class PresentState:
    """The fields of `joined_states`, each copied when it is read first: before the next step.

    A field that is read later raises `CommandError`, once `expire` has been called.
    """

    def __init__(self, states: Sequence[FleetState], shape: tuple[int, ...]) -> None:
        self._states: Sequence[FleetState] | None = states
        self._shape = shape

    def expire(self) -> None:
        """Ends the present; fields that have been read remain."""
        self._states = None

    def __getattr__(self, name: str) -> NDArray[np.generic]:
        if name not in FleetState._fields:
            raise AttributeError(f"a state has no field '{name}'")
        if self._states is None:
            raise CommandError(f"{name} was not read before the next step; read it again there")
        array = _joined([getattr(state, name) for state in self._states], self._shape)
        setattr(self, name, array)
        return array


def _joined(arrays: Sequence[NDArray[np.generic]], shape: tuple[int, ...]) -> NDArray[np.generic]:
    return np.concatenate(arrays).reshape(*shape, *arrays[0].shape[1:])
