"""Defines the handle on one UAV of a running simulation."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.control.pose_stream import NO_STAMP
from volery.control.setpoints import MAX_COORDINATE, checked
from volery.control.trajectory import Trajectory
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.core.uncopied import Uncopied
from volery.runtime.vehicles.flight_future import CommandResult, FlightFuture
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.low_battery import check_charge
from volery.runtime.vehicles.uav_sensors import UavSensors
from volery.scenario.schema import Flight
from volery.vehicle.airframe import Airframe

CheckGoal = Callable[[Array, Airframe], None]
"""Raises `CommandError` if a UAV cannot be at a position (3,), m, in the map frame."""


class Uav(Uncopied):
    """Reads the true state of a UAV and its sensors, and commands it.

    Commands act from the next physics step and raise `CommandError` if they are rejected. Flight
    modes (`take_off`, `go_to`, ...) return a `FlightFuture`, which knows when the command is done,
    or why it failed. Use it in the simulation's thread: between runs, in callbacks of the graph, or
    in a function passed to `Simulation.post`.
    """

    sensors: UavSensors
    """Sensors by name: `uav.sensors["imu"].latest`."""

    def __init__(
        self,
        fleet: Fleet,
        row: int,
        name: str,
        flight: Flight,
        type_name: str = "",
        check_goal: CheckGoal | None = None,
        *,
        sensors: UavSensors,
        futures: FlightFutures,
        path: str = "",
    ) -> None:
        self._slot: tuple[Fleet, int] | None = (fleet, row)
        self.sensors = sensors
        self._futures = futures
        self._path = path or name
        """Its name among those of all environments."""
        self._flight = flight
        self.name = name
        """Its name, such as `uav1`."""
        self.type_name = type_name
        """Its type in the scenario."""
        self._check_goal = check_goal

    def __repr__(self) -> str:
        kind = f" ({self.type_name})" if self.type_name else ""
        if self._slot is None:
            return f"<Uav '{self._path}'{kind}: deleted>"
        x, y, z = self.position_map.tolist()
        return f"<Uav '{self._path}'{kind}: {self.mode.name} at ({x:.2f}, {y:.2f}, {z:.2f}) m>"

    def _repr_html_(self) -> str:
        """Returns flight mode, motion, battery and sensors, for notebooks."""
        from volery.figures.notebook import state_html

        if self.is_deleted:
            return state_html(repr(self), "", {})
        rows = {
            "flight mode": self.mode.name,
            "command": self.pending_command.command if self.pending_command else "none",
            "position (map), m": ", ".join(f"{value:.2f}" for value in self.position_map),
            "velocity (map), m/s": ", ".join(f"{value:.2f}" for value in self.velocity_map),
            "battery": f"{100.0 * self.battery_charge:.0f} %",
            "sensors": ", ".join(self.sensors) or "none",
        }
        kind = f"{self.type_name}, {self.airframe.title}" if self.type_name else ""
        return state_html(self.name, kind, rows)

    def move_to(self, place: tuple[Fleet, int] | None) -> None:
        """Follows the UAV to another fleet and row, or marks the UAV as deleted (None)."""
        self._slot = place

    @property
    def is_deleted(self) -> bool:
        """Whether it was deleted; its state and commands then raise `CommandError`."""
        return self._slot is None

    @property
    def _fleet(self) -> Fleet:
        return self._found()[0]

    @property
    def _row(self) -> int:
        return self._found()[1]

    @property
    def fleet_row(self) -> tuple[Fleet, int]:
        """Its fleet and row. Raises `CommandError` if it was deleted."""
        return self._found()

    def _found(self) -> tuple[Fleet, int]:
        if self._slot is None:
            raise CommandError(f"{self.name} was deleted")
        return self._slot

    @property
    def airframe(self) -> Airframe:
        """Airframe of the UAV."""
        return self._fleet.airframes[self._row]

    # ------------------------------------------------------------------------------------- state

    @property
    def position_map(self) -> Array:
        """Position (3,), m, in the map frame."""
        return np.array(self._fleet.state.position_map[self._row])

    @property
    def velocity_map(self) -> Array:
        """Velocity (3,), m/s, in the map frame."""
        return np.array(self._fleet.state.velocity_map[self._row])

    @property
    def attitude(self) -> Array:
        """Quaternion (4,), x y z w, from the body frame to the map frame."""
        return np.array(self._fleet.state.attitude[self._row])

    @property
    def omega_body(self) -> Array:
        """Angular velocity (3,), rad/s, in the body frame (FLU)."""
        return np.array(self._fleet.state.omega_body[self._row])

    @property
    def acceleration_map(self) -> Array:
        """Acceleration (3,), m/s^2, in the map frame, averaged over the last step."""
        return np.array(self._fleet.state.acceleration_map[self._row])

    @property
    def angular_acceleration_body(self) -> Array:
        """Angular acceleration (3,), rad/s^2, in the body frame (FLU), mean of the last step."""
        return np.array(self._fleet.state.angular_acceleration_body[self._row])

    @property
    def rotor_speed(self) -> Array:
        """Rotor speeds (R,), rad/s."""
        rotors = len(self._fleet.airframes[self._row].rotors.places)
        return np.array(self._fleet.state.rotor_speed[self._row, :rotors])

    @property
    def rotor_reference(self) -> Array:
        """Rotor speeds (R,), rad/s, that the controllers command."""
        return self._fleet.rotor_reference(self._row)

    @property
    def battery_charge(self) -> float:
        """Remaining fraction of the battery capacity; 1 without a battery."""
        return float(self._fleet.state.battery_charge[self._row])

    @property
    def battery_voltage(self) -> float:
        """Voltage under the present load, V; 0 without a battery."""
        return float(self._fleet.state.battery_voltage[self._row])

    @property
    def mode(self) -> FlightMode:
        """Present flight mode."""
        return self._fleet.mode(self._row)

    @property
    def crashed(self) -> bool:
        """Whether the UAV has crashed; its rotors do not start again."""
        return bool(self._fleet.state.crashed[self._row])

    @property
    def rotors_stopped(self) -> bool:
        """Whether `stop_rotors` was its last command."""
        return self._fleet.rotors_stopped(self._row)

    # ------------------------------------------------------------------------------------- faults

    def set_rotor_health(self, rotor: int, factor: float) -> None:
        """Scales the max thrust of rotor `rotor` by `factor` (0 to 1); 0 stops the rotor."""
        self._fleet.set_rotor_health(self._row, rotor, factor)

    # ------------------------------------------------------------------------------ flight modes

    def wait(self, timeout_s: float = 60.0) -> CommandResult | None:
        """Waits for the present flight command, such as the take-off at the scenario's start.

        Returns its result, None if the UAV has no command to complete. See `FlightFuture.wait`.
        Raises `CommandError` if it has crashed.
        """
        future = self.pending_command
        if future is None and self.crashed:
            raise CommandError(f"{self._path} has crashed: there is nothing to wait for")
        return None if future is None else future.wait(timeout_s)

    @property
    def pending_command(self) -> FlightFuture | None:
        """Future of the flight command that it carries out; None if all are done."""
        return self._futures.pending(self._path)

    def take_off(self, altitude_m: float | None = None) -> FlightFuture:
        """Climbs by `altitude_m` (default: the scenario's) and holds; done when it holds.

        Raises `CommandError` if its battery is empty, or so low that its type's
        `low_battery_action` would end the flight.
        """
        if self.mode is FlightMode.LANDED:
            check_charge(self._fleet, self._row, self._flight.low_battery_action)
        altitude = self._flight.take_off_altitude_m if altitude_m is None else altitude_m
        self._fleet.take_off(self._row, float(checked("altitude", altitude, (), MAX_COORDINATE)))
        return self._begun("take_off", (FlightMode.TAKE_OFF,))

    def hold(self) -> FlightFuture:
        """Stops and holds the position; done when it has stopped."""
        self._fleet.hold(self._row)
        return self._begun("hold", (FlightMode.HOLD,))

    def go_to(self, position_map: ArrayLike, yaw: float | None = None) -> FlightFuture:
        """Flies to `position_map` (3,), m, in the map frame and holds there; done on arrival.

        `yaw` is in rad; None keeps the heading. Raises `CommandError` if the position is below the
        ground or inside an obstacle.
        """
        if self._check_goal is not None:
            self._check_goal(checked("position", position_map, (3,), MAX_COORDINATE), self.airframe)
        self._fleet.command_position(self._row, position_map, yaw)
        return self._begun("go_to", (FlightMode.GO_TO,))

    def follow_trajectory(self, trajectory: Trajectory) -> FlightFuture:
        """Flies along `trajectory`, whose time starts now, then holds; done at its end."""
        if not isinstance(trajectory, Trajectory):
            raise CommandError(
                f"a Trajectory is needed, not {type(trajectory).__name__}; Trajectory.from_samples "
                "makes one of positions"
            )
        self._fleet.command_trajectory(self._row, trajectory)
        return self._begun("follow_trajectory", (FlightMode.TRAJECTORY,))

    def land(self) -> FlightFuture:
        """Descends at the present position; done when the rotors have stopped on the ground."""
        self._fleet.land(self._row)
        return self._begun("land", (FlightMode.LAND,), FlightMode.LANDED)

    def set_landing_speed(self, speed_m_s: float) -> None:
        """Sets the descent speed until touchdown, m/s, limited to that of the airframe.

        Raises `CommandError` if the speed is not finite.
        """
        if math.isinf(speed_m_s):
            raise CommandError(f"landing speed = {speed_m_s} m/s is not finite")
        self._fleet.set_landing_speed(self._row, min(speed_m_s, self.airframe.limits.descent_m_s))

    def return_home(self) -> FlightFuture:
        """Climbs, flies back to the take-off position and lands there; done on the ground."""
        self._fleet.return_home(self._row, self._flight.return_altitude_m)
        modes = (FlightMode.RETURN, FlightMode.LAND)
        return self._begun("return_home", modes, FlightMode.LANDED)

    def set_command_timeout(self, seconds: float) -> None:
        """Sets the time (s, max 60) without velocity command or setpoint after which it holds."""
        self._fleet.set_command_timeout(seconds, self._row)

    def stop_rotors(self) -> None:
        """Stops the rotors with the next physics step, also in the air, where the UAV then falls.

        A flight mode starts the rotors again. A kinematic UAV stops in the air instead of falling.
        """
        if self.mode not in (FlightMode.LANDED, FlightMode.CRASHED):
            self._fleet.stop_rotors(self._row)
            self._replaced("stop_rotors")

    def _begun(
        self,
        command: str,
        active: tuple[FlightMode, ...],
        final: FlightMode = FlightMode.HOLD,
    ) -> FlightFuture:
        return self._futures.begin(self._path, command, active, final)

    def _replaced(self, command: str) -> None:
        """Fails the future of the command before."""
        self._futures.replace(self._path, command)

    # ------------------------------------------------------------------------ lower-level commands

    def command_velocity(self, velocity: ArrayLike, yaw_rate: float = 0.0) -> None:
        """Flies at `velocity` (3,), m/s, in the level heading frame (FLU), `yaw_rate` in rad/s.

        The UAV holds if no further command arrives within the scenario's `command_timeout_s`.
        """
        self._fleet.command_velocity_body(self._row, velocity, yaw_rate)
        self._replaced("command_velocity")

    def command_velocity_map(
        self, velocity: ArrayLike, yaw_rate: float = 0.0, *, yaw: float | None = None
    ) -> None:
        """Flies at `velocity` (3,), m/s, in the map; `yaw_rate` in rad/s or `yaw` in rad."""
        self._fleet.command_velocity_map(self._row, velocity, yaw_rate, yaw=yaw)
        self._replaced("command_velocity_map")

    def command_acceleration(
        self, acceleration_map: ArrayLike, yaw: float | None = None, yaw_rate: float = 0.0
    ) -> None:
        """Accelerates by (3,), m/s^2, in the map frame at `yaw`, rad (None keeps the heading)."""
        self._fleet.command_acceleration(self._row, acceleration_map, yaw=yaw, yaw_rate=yaw_rate)
        self._replaced("command_acceleration")

    def command_setpoint(
        self,
        position_map: ArrayLike,
        velocity_map: ArrayLike = (0.0, 0.0, 0.0),
        acceleration_map: ArrayLike = (0.0, 0.0, 0.0),
        yaw: float | None = None,
        yaw_rate: float = 0.0,
    ) -> None:
        """Commands one point of a trajectory: position, velocity and acceleration in the map frame.

        Vectors are (3,), in m, m/s and m/s^2; `yaw` is in rad (None keeps the heading), `yaw_rate`
        in rad/s. The UAV extrapolates until the next setpoint, or holds after the scenario's
        `command_timeout_s`.
        """
        self._fleet.command_setpoint(
            self._row, position_map, velocity_map, acceleration_map, yaw, yaw_rate
        )
        self._replaced("command_setpoint")

    def command_pose(
        self,
        position_map: ArrayLike,
        attitude: ArrayLike,
        velocity_map: ArrayLike | None = None,
        omega_body: ArrayLike | None = None,
        *,
        stamp_ns: int = NO_STAMP,
    ) -> None:
        """Sets the pose with the next step; kinematic UAVs only.

        Position (3,), m, velocity (3,), m/s, and attitude (4,), x y z w, are in the map; angular
        velocity (3,), rad/s, is in the body frame (FLU). Without velocities the sensors measure
        the motion between successive poses; stamp_ns: simulated time of the pose, else it is that
        of the command. A jump faster than three times the airframe's limits, and 20 m/s, is a
        teleport without velocity.
        """
        self._fleet.command_pose(
            self._row, position_map, attitude, velocity_map, omega_body, stamp_ns=stamp_ns
        )
        self._replaced("command_pose")

    def command_attitude(self, attitude: ArrayLike, thrust: float) -> None:
        """Holds `attitude` (4,), x y z w, with a thrust in N along the body's z axis."""
        self._fleet.command_attitude(self._row, attitude, thrust)
        self._replaced("command_attitude")

    def command_rates(self, omega_body: ArrayLike, thrust: float) -> None:
        """Turns at `omega_body` (3,), rad/s, with a thrust in N along the body's z axis."""
        self._fleet.command_rates(self._row, omega_body, thrust)
        self._replaced("command_rates")

    def command_rotor_speeds(self, speeds: ArrayLike) -> None:
        """Turns the rotors at `speeds` (R,), rad/s."""
        self._fleet.command_rotor_speeds(self._row, speeds)
        self._replaced("command_rotor_speeds")
