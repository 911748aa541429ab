"""The commands of a fleet: validated, then written into the rows that the compiled step reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control import batch_commands
from volery.control.estimated_state import EstimatedState
from volery.control.flight_modes import FlightMode
from volery.control.pose_stream import NO_DEADLINE, NO_STAMP, follow_pose
from volery.control.segment_store import SegmentStore
from volery.control.setpoints import (
    MAX_COORDINATE,
    ControlLevel,
    checked,
    checked_attitude,
    checked_within,
)
from volery.control.trajectory import Trajectory
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.vehicle.airframe import GRAVITY, Airframe
from volery.vehicle.identified import IdentifiedModel
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import Plant, RigidBody

DEFAULT_RETURN_HEIGHT_M = 10.0
_MODES = tuple(FlightMode)
"""By their numbers."""


class FleetCommands:
    """Commands to UAVs; `Fleet` adds time and state.

    airframes, plants, names: one per UAV. uavs: (N,) rows of `fused_step.UAV`. dt: physics step, s.
    A command acts from the next step. Commands raise `CommandError`, and change nothing, if the UAV
    does not exist or has crashed, if its plant or flight mode does not support the command, or if a
    value has the wrong shape, is not finite or is out of range.
    """

    def __init__(
        self,
        airframes: tuple[Airframe, ...],
        plants: tuple[Plant, ...],
        names: tuple[str, ...],
        uavs: NDArray[np.void],
        dt: float,
    ) -> None:
        self.airframes = airframes
        self.plants = plants
        self.names = names
        self.step = 0
        self._dt = dt
        self._uavs = uavs
        self._bodies: NDArray[np.void] = uavs["body"]
        self._control_states: NDArray[np.void] = uavs["control_state"]
        self._modes: NDArray[np.int64] = self._control_states["mode"]
        self._paths = SegmentStore(self._control_states)

    def __len__(self) -> int:
        """Number of UAVs."""
        return len(self._uavs)

    def mode(self, i: int) -> FlightMode:
        """Returns the flight mode of UAV `i`."""
        mode: FlightMode = _MODES[self._modes[i]]
        return mode

    def is_braking(self, i: int) -> bool:
        """Returns whether UAV `i` still brakes before it holds its position."""
        return bool(self._control_states["braking"][i])

    @property
    def modes(self) -> NDArray[np.int64]:
        """(N,) flight modes, as integers."""
        return self._modes.copy()

    def set_command_timeout(self, seconds: float, i: int | None = None) -> None:
        """Sets the time without setpoints after which UAV `i` (None: all) holds.

        It counts from the last velocity or trajectory setpoint. seconds: above 0, up to 60.
        """
        if not 0.0 < seconds <= 60.0:
            raise CommandError(
                f"timeout = {seconds} s is out of range; it must be above 0 and up to 60 s"
            )
        rows = slice(None) if i is None else i
        self._control_states["timeout_steps"][rows] = max(1, round(seconds / self._dt))

    def rotor_reference(self, i: int) -> Array:
        """Returns the rotor speed setpoints (R,) rad/s of UAV `i` in the last step."""
        rotors = len(self.airframes[i].rotors.places)
        return np.array(self._control_states["rotor_reference"][i, :rotors])

    def command_rotor_speeds(self, i: int, speeds: ArrayLike) -> None:
        """Sets the rotor speeds (R,) rad/s of UAV `i`, within what its battery allows."""
        self._refuse_plants(i, "rotor speeds", IdentifiedModel, Kinematic)
        rotors = self.airframes[i].rotors
        shape = (len(rotors.places),)
        speeds = checked_within("rotor speeds", speeds, shape, rotors.max_speed_rad_s)
        control_state = self._enter_low_level(i, ControlLevel.ROTORS)
        control_state["rotor_target"][: len(speeds)] = speeds

    def stop_rotors(self, i: int) -> None:
        """Stops the rotors of UAV `i` at once; in the air a flight mode restarts them.

        A kinematic UAV, which has no rotors, hovers in place.
        """
        control_state = self._enter_low_level(i, ControlLevel.STOPPED)
        control_state["rotor_target"] = 0.0
        control_state["thrust"] = 0.0

    def rotors_stopped(self, i: int) -> bool:
        """Returns whether `stop_rotors` was the last command to UAV `i`."""
        row = self._control_states[i]
        return bool(row["level"] == ControlLevel.STOPPED and row["mode"] == FlightMode.LOW_LEVEL)

    def command_rates(self, i: int, omega_body: ArrayLike, thrust: float) -> None:
        """Sets body rates (3,) rad/s, FLU, and `thrust` N along the z axis of UAV `i`."""
        self._refuse_plants(i, "rates", IdentifiedModel, Kinematic)
        limit = 4.0 * math.radians(self.airframes[i].limits.rate_deg_s)
        omega_body = checked("rates", omega_body, (3,), limit)
        thrust = self._checked_thrust(i, thrust)
        control_state = self._enter_low_level(i, ControlLevel.RATES)
        control_state["rates"] = omega_body
        control_state["thrust"] = thrust

    def command_attitude(self, i: int, attitude: ArrayLike, thrust: float) -> None:
        """Sets the attitude (4,), map from body, and `thrust` N along the z axis of UAV `i`."""
        self._refuse_plants(i, "attitudes", Kinematic)
        attitude = checked_attitude(attitude)
        thrust = self._checked_thrust(i, thrust)
        control_state = self._enter_low_level(i, ControlLevel.ATTITUDE)
        control_state["attitude"] = attitude
        control_state["thrust"] = thrust
        control_state["yaw_rate"] = 0.0

    def command_velocity_body(self, i: int, velocity: ArrayLike, yaw_rate: float = 0.0) -> None:
        """Sets the velocity (3,) m/s of UAV `i` in its level heading frame.

        The frame has x forward, y left, z up. As a ROS Twist: the velocity turns with the vehicle,
        yaw_rate is in rad/s. The setpoint holds until the timeout, then the UAV brakes and holds
        its position. Velocities beyond the airframe's limits are limited.
        """
        rate = checked("yaw rate", yaw_rate, (), 100.0)
        self._command_velocity(i, velocity, in_heading=True)
        self._turn(i, rate)

    def command_velocities(self, velocity: Array, yaw_rate: Array) -> None:
        """Sets velocities (N, 3) m/s in level heading frames, and yaw rates (N,) rad/s.

        As `command_velocity_body` for each UAV, but UAVs that are on the ground, crashed or taking
        off are skipped.
        """
        velocity = checked("velocity", velocity, (len(self), 3), 1e3)
        rate = checked("yaw rate", yaw_rate, (len(self),), 100.0)
        batch_commands.command_velocities(
            self._bodies, self._control_states, self.step, velocity, rate
        )

    def command_all(self, level: ControlLevel, setpoints: Mapping[str, Array | float]) -> None:
        """Sets setpoints of a level below guidance for all UAVs that have not crashed.

        setpoints: arrays (N, ...), or one number for all, by field of `CONTROL_STATE`; the caller
        has checked them with `BatchLimits`.
        """
        batch_commands.command_low_level(
            self._bodies, self._control_states, self.step, level, setpoints
        )

    def command_map_velocities(self, velocity: Array, yaw: Array | None, yaw_rate: Array) -> None:
        """Sets velocities (N, 3) m/s, map, with yaws (N,) rad, or yaw rates (N,) rad/s.

        As `command_velocity_map` for each UAV, but UAVs on the ground, crashed or taking off are
        skipped. The caller has checked the values with `BatchLimits`.
        """
        rows = self._enter_guided_all(FlightMode.VELOCITY)
        batch_commands.command_map_velocities(
            self._control_states, rows, self.step, velocity, yaw, yaw_rate
        )

    def command_setpoints(
        self, setpoints: Mapping[str, Array], yaw: Array | None, yaw_rate: Array
    ) -> None:
        """Sets trajectory points as `command_setpoint` does for each UAV.

        setpoints: `position_target`, `velocity_target`, `acceleration_target`, (N, 3) each. UAVs on
        the ground, crashed or taking off are skipped. The caller has checked the values with
        `BatchLimits`.
        """
        rows = self._enter_guided_all(FlightMode.TRAJECTORY)
        batch_commands.command_setpoints(
            self._control_states, rows, self.step, setpoints, yaw, yaw_rate
        )

    def command_velocity_map(
        self, i: int, velocity: ArrayLike, yaw_rate: float = 0.0, *, yaw: float | None = None
    ) -> None:
        """Sets the velocity (3,) m/s, map, of UAV `i`, with `yaw_rate` rad/s or `yaw` rad."""
        rate = checked("yaw rate", yaw_rate, (), 100.0)
        angle = None if yaw is None else checked("yaw", yaw, (), 1e4)
        self._command_velocity(i, velocity, in_heading=False)
        if angle is None:
            self._turn(i, rate)
        else:
            self._face(i, float(angle))

    def command_position(self, i: int, position: ArrayLike, yaw: float | None = None) -> None:
        """Sends UAV `i` to `position` (3,) m, map, with heading `yaw` rad (None: unchanged)."""
        position = checked("position", position, (3,), MAX_COORDINATE)
        angle = None if yaw is None else float(checked("yaw", yaw, (), 1e4))
        control_state = self._enter_guided(i, FlightMode.GO_TO)
        control_state["position_target"] = position
        if angle is not None:
            self._face(i, angle)

    def command_setpoint(
        self,
        i: int,
        position: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        acceleration: ArrayLike = (0.0, 0.0, 0.0),
        yaw: float | None = None,
        yaw_rate: float = 0.0,
    ) -> None:
        """Sets the present trajectory point of UAV `i`: position, velocity, acceleration (3,), map.

        For trajectories that a client computes (m, m/s, m/s^2; yaw in rad, None: unchanged, turning
        at yaw_rate rad/s). The setpoint moves on with its velocity and acceleration until the next
        one arrives or, after the timeout, the UAV holds. For distant goals use `command_position`.
        """
        position = checked("position", position, (3,), MAX_COORDINATE)
        velocity = checked("velocity", velocity, (3,), 1e3)
        acceleration = checked("acceleration", acceleration, (3,), 1e3)
        angle = None if yaw is None else float(checked("yaw", yaw, (), 1e4))
        rate = checked("yaw rate", yaw_rate, (), 100.0)
        control_state = self._enter_guided(i, FlightMode.TRAJECTORY)
        control_state["path_last"] = -1
        control_state["start_step"] = self.step
        control_state["deadline_step"] = self.step + control_state["timeout_steps"]
        control_state["position_target"] = position
        control_state["velocity_target"] = velocity
        control_state["acceleration_target"] = acceleration
        if angle is not None:
            self._face(i, angle)
            control_state["yaw_rate_target"] = rate
        elif rate != 0.0:
            self._turn(i, rate)
        else:
            control_state["yaw_rate_target"] = 0.0

    def command_trajectory(self, i: int, trajectory: Trajectory) -> None:
        """Sends UAV `i` along `trajectory` from now on, then holds.

        Times count from this step. If the trajectory begins later than at 0 s, an additional
        segment leads to it from the present motion. Positions are in the map frame: a UAV that is
        elsewhere approaches at about 1 m/s in addition to the commanded motion.
        """
        self._refuse_wreck(i)
        motion = self._believed(i)
        trajectory = trajectory.led_in_from(
            motion.position, motion.velocity, float(rotations.yaw_of(motion.attitude))
        )
        control_state = self._enter_guided(i, FlightMode.TRAJECTORY)
        control_state["start_step"] = self.step
        control_state["path_faces"] = trajectory.faces
        self._paths.put(i, trajectory.segments)

    def command_pose(
        self,
        i: int,
        position: ArrayLike,
        attitude: ArrayLike,
        velocity: ArrayLike | None = None,
        omega_body: ArrayLike | None = None,
        *,
        stamp_ns: int = NO_STAMP,
    ) -> None:
        """Sets the pose of the kinematic UAV `i` from the next step on.

        position: (3,) m, map; attitude: (4,), map from body. The pose holds until the next command.
        velocity: (3,) m/s, map, and omega_body: (3,) rad/s, FLU, are the motion that its sensors
        measure; one alone leaves the other zero. Without both, they measure the motion between the
        poses of a stream, see `control.pose_stream`; stamp_ns: simulated time of the pose, ns. A
        pose that is older than the last one is ignored.
        """
        self._refuse_plants(i, "poses", RigidBody, IdentifiedModel)
        position = checked("position", position, (3,), MAX_COORDINATE)
        attitude = checked_attitude(attitude)
        implied = velocity is None and omega_body is None
        none = (0.0, 0.0, 0.0)
        velocity = checked("velocity", none if velocity is None else velocity, (3,), 1e3)
        omega_body = checked("rates", none if omega_body is None else omega_body, (3,), 1e3)
        in_stream = bool(self._control_states["level"][i] == ControlLevel.POSE)
        control_state = self._enter_low_level(i, ControlLevel.POSE)
        if implied:
            limits = self.airframes[i].limits
            is_present = follow_pose(
                control_state,
                position,
                attitude,
                stamp_ns,
                in_stream=in_stream,
                step=self.step,
                dt=self._dt,
                limits=limits,
            )
            if not is_present:
                return
        else:
            control_state["start_step"] = self.step
            control_state["pose_stamp"] = stamp_ns
            control_state["velocity_target"] = velocity
            control_state["rates"] = omega_body
            control_state["pose_steps"] = 1
            control_state["deadline_step"] = NO_DEADLINE
        control_state["position_target"] = position
        control_state["attitude"] = attitude

    def take_off(self, i: int, altitude_m: float = 2.5) -> None:
        """Starts the take-off of the landed UAV `i` to `altitude_m` above its position."""
        if not (math.isfinite(altitude_m) and 0.0 < altitude_m <= MAX_COORDINATE):
            raise CommandError(f"take-off altitude = {altitude_m} m must be a height above ground")
        self._refuse_wreck(i)
        if self.mode(i) is not FlightMode.LANDED:
            raise CommandError(
                f"{self.names[i]} cannot take off: it is flying ({self.mode(i).name})"
            )
        position = self._believed(i).position
        self._control_states["home"][i] = position
        control_state = self._enter_guided(i, FlightMode.TAKE_OFF, from_ground=True)
        control_state["position_target"] = position + np.array([0.0, 0.0, altitude_m])

    def hold(self, i: int) -> None:
        """Stops UAV `i` and holds the position at which it comes to rest."""
        control_state = self._enter_guided(i, FlightMode.HOLD)
        control_state["braking"] = control_state["hurried"] = True

    def land(self, i: int) -> None:
        """Stops UAV `i`, lands it straight below and stops its rotors on the ground.

        The descent begins once the UAV has nearly stopped, or at the latest after three times the
        time that braking needs, where gusts or an estimate that drifts keep it in motion.
        """
        if self.mode(i) is FlightMode.LANDED:
            raise CommandError(f"{self.names[i]} is on the ground already")
        control_state = self._enter_guided(i, FlightMode.LAND)
        vx, vy, _ = self._believed(i).velocity
        braking_s = math.hypot(vx, vy) / self.airframes[i].limits.acceleration_m_s2
        control_state["deadline_step"] = self.step + round((1.0 + 3.0 * braking_s) / self._dt)
        control_state["braking"] = True
        control_state["sink"] = 0.0

    def set_landing_speed(self, i: int, speed_m_s: float) -> None:
        """Sets the descent speed of the present landing of UAV `i`, instead of its airframe's."""
        if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
            raise CommandError(f"landing speed = {speed_m_s} m/s must be above 0")
        if self.mode(i) is not FlightMode.LAND:
            raise CommandError(f"{self.names[i]} is not landing ({self.mode(i).name})")
        self._control_states["sink"][i] = speed_m_s

    def return_home(self, i: int, height_m: float = DEFAULT_RETURN_HEIGHT_M) -> None:
        """Returns UAV `i` to its home, at least `height_m` above it, and lands it there."""
        if not (math.isfinite(height_m) and 0.0 < height_m <= MAX_COORDINATE):
            raise CommandError(f"return height = {height_m} m must be a height above home")
        control_state = self._enter_guided(i, FlightMode.RETURN)
        control_state["braking"] = True
        control_state["phase"] = 0
        control_state["sink"] = 0.0
        control_state["return_height"] = max(
            float(control_state["home"][2]) + height_m, float(self._believed(i).position[2])
        )

    def command_acceleration(
        self,
        i: int,
        acceleration: ArrayLike,
        *,
        yaw: float | None = None,
        yaw_rate: float = 0.0,
    ) -> None:
        """Sets the acceleration (3,) m/s^2, map, of UAV `i`, with heading `yaw` rad.

        With `yaw` None the heading is unchanged; the UAV also turns at `yaw_rate` rad/s. The thrust
        points along the sum that gravity and acceleration require, with a tilt up to the airframe's
        limit; drag and wind are not compensated. Like an attitude, the setpoint holds until the
        next command.
        """
        acceleration = checked("acceleration", acceleration, (3,), 1e3)
        angle = None if yaw is None else float(checked("yaw", yaw, (), 1e4))
        rate = float(checked("yaw rate", yaw_rate, (), 100.0))
        self._refuse_plants(i, "accelerations", Kinematic)
        airframe = self.airframes[i]
        lift = max(0.0, float(acceleration[2]) + GRAVITY)
        level = np.array(acceleration[:2])
        size, limit = (
            float(np.linalg.norm(level)),
            lift * math.tan(math.radians(airframe.limits.tilt_deg)),
        )
        if size > limit:
            level *= limit / size
        if angle is None:
            angle = float(rotations.yaw_of(self._believed(i).attitude))
        max_thrust = len(airframe.rotors.places) * airframe.max_rotor_thrust
        thrust = airframe.body.mass_kg * math.hypot(*level, lift)
        control_state = self._enter_low_level(i, ControlLevel.ATTITUDE)
        up = np.array([-level[1], level[0], 0.0, math.hypot(*level, lift) + lift])
        facing = [0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]
        upright = bool(up.any())  # else free fall, at any attitude
        control_state["attitude"] = (
            rotations.multiply(rotations.normalize(up), facing) if upright else facing
        )
        control_state["thrust"] = min(thrust, max_thrust)
        control_state["yaw_rate"] = rate

    # -------------------------------------------------------------------------------- inside

    def _refuse_wreck(self, i: int) -> None:
        if not 0 <= i < len(self):
            raise CommandError(f"there is no UAV {i}; rows 0 to {len(self) - 1} exist")
        if self._bodies["crashed"][i]:
            raise CommandError(f"{self.names[i]} has crashed")

    def _refuse_plants(self, i: int, what: str, *plants: type[Plant]) -> None:
        self._refuse_wreck(i)
        if isinstance(self.plants[i], plants):
            kind = type(self.plants[i]).__name__
            raise CommandError(f"{self.names[i]} does not accept {what}: its plant is a {kind}")

    def _checked_thrust(self, i: int, thrust: float) -> float:
        airframe = self.airframes[i]
        max_thrust = len(airframe.rotors.places) * airframe.max_rotor_thrust
        return float(checked_within("thrust", thrust, (), max_thrust))

    def _wake(self, i: int) -> None:
        if self._bodies["on_ground"][i] or self._bodies["asleep"][i]:
            self._bodies["last_contact_step"][i] = self.step  # at rest: no new contact
        self._bodies["asleep"][i] = False
        self._bodies["still_steps"][i] = 0
        self._bodies["ground_budget"][i] = 0.0
        self._bodies["downwash_budget"][i] = 0.0

    def believed(self, rows: NDArray[np.int64]) -> tuple[EstimatedState, Array]:
        """Returns the motion of the UAVs `rows` (n,) that their controllers use, a row each.

        The second value are their body rates (n, 3) rad/s, FLU.
        """
        rates = self._bodies["omega_body"][rows] + self._uavs["belief"]["rate_error"][rows]
        return self._believed(rows), rates

    def _believed(self, i: int | NDArray[np.int64]) -> EstimatedState:
        """Returns the present motion of UAV `i` that its controllers use."""
        body, belief = self._bodies[i], self._uavs["belief"][i]
        return EstimatedState(
            body["position_map"] + belief["position_error"],
            body["velocity_map"] + belief["velocity_error"],
            rotations.multiply(belief["rotation_error"], body["attitude"]),
        )

    def _enter_low_level(self, i: int, level: ControlLevel) -> Any:
        self._wake(i)
        control_state: Any = self._control_states[i]
        control_state["mode"] = FlightMode.LOW_LEVEL
        control_state["level"] = level
        return control_state

    def _enter_guided(self, i: int, mode: FlightMode, *, from_ground: bool = False) -> Any:
        self._refuse_wreck(i)
        if self.mode(i) is FlightMode.LANDED and not from_ground:
            raise CommandError(f"{self.names[i]} is on the ground; it must take off first")
        self._wake(i)
        control_state: Any = self._control_states[i]
        if control_state["level"] != ControlLevel.GUIDED:
            motion = self._believed(i)
            yaw = float(rotations.yaw_of(motion.attitude))
            control_state["level"] = ControlLevel.GUIDED
            control_state["position"] = motion.position
            control_state["velocity"] = motion.velocity
            control_state["acceleration"] = 0.0
            control_state["velocity_integral"] = 0.0
            control_state["heading"] = control_state["heading_target"] = (
                math.cos(yaw),
                math.sin(yaw),
            )
        if mode is not FlightMode.VELOCITY and control_state["turning"]:
            control_state["heading_target"] = control_state["heading"]
            control_state["turning"] = False
        control_state["mode"] = mode
        control_state["braking"] = False
        control_state["calm_ticks"] = 0
        return control_state

    def _enter_guided_all(self, mode: FlightMode) -> NDArray[np.int64]:
        return batch_commands.enter_guided(
            self._bodies, self._control_states, self.step, mode, self._believed
        )

    def _command_velocity(self, i: int, velocity: ArrayLike, *, in_heading: bool) -> None:
        velocity = checked("velocity", velocity, (3,), 1e3)
        control_state = self._enter_guided(i, FlightMode.VELOCITY)
        control_state["hurried"] |= not velocity.any() and bool(
            control_state["velocity_target"].any()
        )
        control_state["velocity_target"] = velocity
        control_state["velocity_in_heading"] = in_heading
        control_state["deadline_step"] = self.step + control_state["timeout_steps"]

    def _turn(self, i: int, rate: Array) -> None:
        self._control_states["turning"][i] = True
        self._control_states["yaw_rate_target"][i] = rate

    def _face(self, i: int, yaw: float) -> None:
        self._control_states["turning"][i] = False
        self._control_states["heading_target"][i] = math.cos(yaw), math.sin(yaw)
