"""A fleet of UAVs: give commands, advance time, read the state, collect what happened.

`Fleet` owns all state of plants and controllers as rows of arrays; the compiled step
(`control.step`) does the work. It knows the ground and the wind; trees and other UAVs are the
engine's business, which looks up clearances, fills the budgets and calls `strike`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.flight_modes import FlightMode
from volery.control.gains import ATTITUDE_PERIOD_S, GUIDANCE_PERIOD_S, gains_of, steps_of
from volery.control.setpoints import (
    MAX_COORDINATE,
    PILOT,
    ControlLevel,
    checked,
    checked_attitude,
    checked_within,
    new_pilots,
)
from volery.control.step import (
    BATTERY_FELL,
    EVENT,
    EVENTS_A_STEP,
    MODE_CHANGE,
    MODEL,
    UAV,
    advance_fleet,
)
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import Airframe, hover_thrusts
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.battery import BatteryLevel
from volery.vehicle.contact import IMPACT, TOUCH_DOWN, steepest_cosine
from volery.vehicle.downwash import new_jets
from volery.vehicle.fleet import FleetState, charge_battery, fit_rotors, new_bodies, state_of
from volery.vehicle.plant import plant_of
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.terrain import TerrainGrid

Array = NDArray[np.float64]

DEFAULT_TIMEOUT_S = 0.5
"""s after which a velocity command without successor ends in HOLD."""
DEFAULT_RETURN_HEIGHT_M = 10.0
_MAX_STEP_NS = 5_000_000


class FleetEventKind(StrEnum):
    """Kinds of events."""

    TOUCH_DOWN = "touch_down"
    """Touched the ground as a landing may."""
    IMPACT = "impact"
    """Touched the ground faster than the landing limit or tilted beyond 60 degrees."""
    MODE = "mode"
    """Changed its flight mode by itself."""
    BATTERY = "battery"
    """Its battery fell to a lower level."""


_KINDS = {
    TOUCH_DOWN: FleetEventKind.TOUCH_DOWN,
    IMPACT: FleetEventKind.IMPACT,
    MODE_CHANGE: FleetEventKind.MODE,
    BATTERY_FELL: FleetEventKind.BATTERY,
}


@dataclass(frozen=True, slots=True)
class FleetEvent:
    """One happening."""

    kind: FleetEventKind
    step: int
    """Physics step at whose end it happened."""
    uav: int
    """Row."""
    position_map: tuple[float, float, float]
    """m."""
    speed_m_s: float
    """Of the centre of mass just before a touch; 0 for a change of mode."""
    mode: FlightMode
    """Mode after a change, mode in which a touch happened."""
    battery_level: BatteryLevel = BatteryLevel.NORMAL
    """At the time."""


class Fleet:
    """N UAVs that fly in lock step.

    airframes: one a UAV. position_map: (N, 3) m. attitude: (N, 4) unit quaternions, map from body.
    dt_ns: physics step. on_contact: what an impact does, "crash" (rotors stop, it falls and rests)
    or "bounce" (it rebounds and flies on). mode: `HOLD` starts in the air with rotors turning,
    `LANDED` on the ground with rotors stopped; one for all or one a UAV. names: for messages.
    wear: of the rotors, one a rotor, for each UAV; an empty one means new. battery_charge: shares
    from 0 to 1, one for all or one a UAV. copies: (N,) whole numbers; UAVs of different copies of
    a scenario do not feel each other's air.

    Rows are numbered from 0. After `advance` the state belongs to time `step * dt_ns`.
    """

    def __init__(
        self,
        airframes: Sequence[Airframe],
        position_map: ArrayLike,
        attitude: ArrayLike,
        *,
        dt_ns: int = 1_000_000,
        on_contact: Literal["crash", "bounce"] = "crash",
        mode: FlightMode | Sequence[FlightMode] = FlightMode.HOLD,
        names: Sequence[str] | None = None,
        wear: Sequence[Sequence[RotorWear]] | None = None,
        battery_charge: ArrayLike = 1.0,
        copies: ArrayLike = 0,
    ) -> None:
        count = len(airframes)
        if count == 0:
            raise CommandError("a fleet needs at least one UAV")
        if not 0 < dt_ns <= _MAX_STEP_NS:
            raise CommandError(f"dt_ns = {dt_ns} is out of range; 1 to {_MAX_STEP_NS} is allowed")
        position = checked("position_map", position_map, (count, 3), MAX_COORDINATE)
        attitude = checked("attitude", attitude, (count, 4), 1.1)
        attitude = np.array([checked_attitude(q) for q in attitude])
        modes = [mode] * count if isinstance(mode, FlightMode) else list(mode)
        if len(modes) != count or not set(modes) <= {FlightMode.HOLD, FlightMode.LANDED}:
            raise CommandError("a UAV starts in HOLD or LANDED, one mode for all or one for each")

        self.airframes = tuple(airframes)
        self.names = tuple(names or (f"UAV {i}" for i in range(count)))
        self.step = 0
        self._dt_ns = int(dt_ns)
        self._dt = dt_ns / NS_PER_S
        self._bounce = on_contact == "bounce"
        self._periods = (
            steps_of(GUIDANCE_PERIOD_S, self._dt),
            steps_of(ATTITUDE_PERIOD_S, self._dt),
        )
        worn = [tuple(one) for one in wear or [()] * count]
        _check_wear(self.names, self.airframes, worn)
        charge = checked_within("battery_charge", _each(battery_charge, count), (count,), 1.0)
        self._models, rows = _model_table(self.airframes, worn, self._dt)
        self._uavs = np.zeros(count, UAV)
        self._uavs["body"] = new_bodies(position, attitude)
        self._uavs["pilot"] = new_pilots(attitude)
        self._uavs["model"] = rows
        self._uavs["copy"] = checked("copies", _each(copies, count), (count,), 2**31)
        self._jets = new_jets(count)
        self._bodies: NDArray[np.void] = self._uavs["body"]
        self._pilots: NDArray[np.void] = self._uavs["pilot"]
        for i, row in enumerate(rows):
            plant = self._models["plant"][row]
            health = [rotor.thrust for rotor in worn[i]] or np.ones(int(plant["rotors"]))
            fit_rotors(self._bodies[i], plant, health)
            charge_battery(self._bodies[i], plant, float(charge[i]))
            self._pilots["full_thrust"][i] = self.airframes[i].max_rotor_thrust
        self._events = np.zeros(max(256, 2 * EVENTS_A_STEP * count), EVENT)
        self._drained: list[FleetEvent] = []
        self._grid: TerrainGrid | None = None
        self._ground: tuple[Array, float, float, float, float] | None = None
        self.state: FleetState = state_of(self._bodies)
        self.history: PoseHistory = new_history(position, attitude, self._dt_ns)
        self._pilots["home"] = position
        self.set_command_timeout(DEFAULT_TIMEOUT_S)
        for i, start in enumerate(modes):
            if start is FlightMode.HOLD:
                self._start_in_air(i)
            else:
                self._bodies["last_contact_step"][i] = 0

    def __len__(self) -> int:
        """Number of UAVs."""
        return len(self._uavs)

    @property
    def dt_ns(self) -> int:
        """Physics step."""
        return self._dt_ns

    @property
    def time_ns(self) -> int:
        """Time since the start."""
        return self.step * self._dt_ns

    # ---------------------------------------------------------------------------------- time

    def advance(
        self,
        steps: int,
        terrain: TerrainGrid,
        wind_map: Sequence[float] | Array = (0.0, 0.0, 0.0),
        *,
        event_ends: bool = False,
    ) -> int:
        """Run up to `steps` physics steps; returns how many were done.

        Fewer are done, all of them whole, when some UAV has used up its `contact_budget` or
        `separation_budget`, or, with `event_ends`, when something happened. `advance(0, ...)`
        compiles the step. wind_map: (3,) m/s.
        """
        if terrain is not self._grid or self._ground is None:
            self._ground = self._ground_of(terrain)
        wx, wy, wz = wind_map
        done = 0
        while True:
            more, written, spent = advance_fleet(
                self._uavs,
                self._models,
                self._jets,
                *self._ground,
                self.history.position,
                self.history.attitude,
                float(wx),
                float(wy),
                float(wz),
                self._events,
                self.step,
                steps - done,
                *self._periods,
                self._dt,
                self._bounce,
                event_ends,
            )
            self.step += more
            done += more
            if written:
                self._drained += [_event(row) for row in self._events[:written]]
            if spent or done >= steps or (event_ends and written):
                return done

    def drain_events(self) -> list[FleetEvent]:
        """What happened since the last call, in order of step, then row."""
        events, self._drained = self._drained, []
        return events

    def _ground_of(self, terrain: TerrainGrid) -> tuple[Array, float, float, float, float]:
        self._grid = terrain
        self._bodies["ground_budget"] = 0.0
        return (
            np.ascontiguousarray(terrain.heights, dtype=np.float64),
            float(terrain.origin_x),
            float(terrain.origin_y),
            float(terrain.spacing),
            steepest_cosine(terrain),
        )

    # ------------------------------------------------------------------------------ commands

    def mode(self, i: int) -> FlightMode:
        """Flight mode of UAV `i`."""
        return FlightMode(int(self._pilots["mode"][i]))

    def set_command_timeout(self, seconds: float, i: int | None = None) -> None:
        """Time without a velocity command after which UAV `i` (None: all) holds; s, up to 60."""
        if not 0.0 < seconds <= 60.0:
            raise CommandError(f"time-out = {seconds} s is out of range; up to 60 s is allowed")
        rows = slice(None) if i is None else i
        self._pilots["timeout_steps"][rows] = max(1, round(seconds / self._dt))

    def command_rotor_speeds(self, i: int, speeds: ArrayLike) -> None:
        """Turn the rotors of UAV `i` at `speeds` (R,) rad/s, if its battery lets them."""
        self._refuse_wreck(i)
        rotors = self.airframes[i].rotors
        shape = (len(rotors.places),)
        speeds = checked_within("rotor speeds", speeds, shape, rotors.max_speed_rad_s)
        pilot = self._enter_low_level(i, ControlLevel.ROTORS)
        pilot["rotor_target"][: len(speeds)] = speeds

    def command_rates(self, i: int, omega_body: ArrayLike, thrust: float) -> None:
        """Turn UAV `i` at `omega_body` (3,) rad/s, FLU, with `thrust` N along its z axis."""
        self._refuse_wreck(i)
        limit = 4.0 * math.radians(self.airframes[i].limits.rate_deg_s)
        omega_body = checked("rates", omega_body, (3,), limit)
        thrust = self._checked_thrust(i, thrust)
        pilot = self._enter_low_level(i, ControlLevel.RATES)
        pilot["rates"] = omega_body
        pilot["thrust"] = thrust

    def command_attitude(self, i: int, attitude: ArrayLike, thrust: float) -> None:
        """Hold UAV `i` at `attitude` (4,), map from body, with `thrust` N along its z axis."""
        self._refuse_wreck(i)
        attitude = checked_attitude(attitude)
        thrust = self._checked_thrust(i, thrust)
        pilot = self._enter_low_level(i, ControlLevel.ATTITUDE)
        pilot["attitude"] = attitude
        pilot["thrust"] = thrust
        pilot["yaw_rate"] = 0.0

    def command_velocity_body(self, i: int, velocity: ArrayLike, yaw_rate: float = 0.0) -> None:
        """Fly UAV `i` at `velocity` (3,) m/s in its level heading frame (x forward, y left, z up).

        A ROS Twist: the velocity turns with the vehicle, yaw_rate is in rad/s. It holds until the
        time-out, then the UAV brakes and holds its place. Beyond the airframe's limits it flies at
        the limit.
        """
        rate = checked("yaw rate", yaw_rate, (), 100.0)
        self._command_velocity(i, velocity, in_heading=True)
        self._turn(i, rate)

    def command_velocity_map(
        self, i: int, velocity: ArrayLike, yaw_rate: float = 0.0, *, yaw: float | None = None
    ) -> None:
        """Fly UAV `i` at `velocity` (3,) m/s, map, turning at `yaw_rate` rad/s or to `yaw` rad."""
        rate = checked("yaw rate", yaw_rate, (), 100.0)
        angle = None if yaw is None else checked("yaw", yaw, (), 1e4)
        self._command_velocity(i, velocity, in_heading=False)
        if angle is None:
            self._turn(i, rate)
        else:
            self._face(i, float(angle))

    def command_position(self, i: int, position: ArrayLike, yaw: float | None = None) -> None:
        """Fly UAV `i` to `position` (3,) m, map, with heading `yaw` rad (None: as it is); hold."""
        position = checked("position", position, (3,), MAX_COORDINATE)
        angle = None if yaw is None else float(checked("yaw", yaw, (), 1e4))
        pilot = self._enter_guided(i, FlightMode.GO_TO)
        pilot["position_target"] = position
        pilot["braking"] = False
        if angle is not None:
            self._face(i, angle)

    def take_off(self, i: int, altitude_m: float = 2.5) -> None:
        """Let UAV `i`, landed, climb to `altitude_m` above its place and hold."""
        if not (math.isfinite(altitude_m) and 0.0 < altitude_m <= MAX_COORDINATE):
            raise CommandError(f"take-off altitude = {altitude_m} m is not a height above ground")
        self._refuse_wreck(i)
        if self.mode(i) is not FlightMode.LANDED:
            raise CommandError(f"{self.names[i]} cannot take off: it flies ({self.mode(i).name})")
        place = self._bodies["position_map"][i].copy()
        self._pilots["home"][i] = place
        pilot = self._enter_guided(i, FlightMode.TAKE_OFF, from_ground=True)
        pilot["position_target"] = place + np.array([0.0, 0.0, altitude_m])
        pilot["braking"] = False

    def hold(self, i: int) -> None:
        """Let UAV `i` stop and stay where it comes to rest."""
        self._enter_guided(i, FlightMode.HOLD)["braking"] = True

    def land(self, i: int) -> None:
        """Let UAV `i` stop, descend straight down and stop its rotors on the ground."""
        self._enter_guided(i, FlightMode.LAND)["braking"] = True

    def return_home(self, i: int, height_m: float = DEFAULT_RETURN_HEIGHT_M) -> None:
        """Let UAV `i` fly back at least `height_m` above its home, and land there."""
        if not (math.isfinite(height_m) and 0.0 < height_m <= MAX_COORDINATE):
            raise CommandError(f"return height = {height_m} m is not a height above home")
        pilot = self._enter_guided(i, FlightMode.RETURN)
        pilot["braking"] = True
        pilot["phase"] = 0
        pilot["return_height"] = max(
            float(pilot["home"][2]) + height_m, float(self._bodies["position_map"][i, 2])
        )

    def set_home(self, i: int, position: ArrayLike) -> None:
        """Place (3,) m, map, to which UAV `i` returns; else that of its last take-off."""
        self._pilots["home"][i] = checked("home", position, (3,), MAX_COORDINATE)

    def set_rotor_health(self, i: int, rotor: int, factor: float) -> None:
        """Let rotor number `rotor` of UAV `i` give `factor` of a new one's thrust from now on.

        From 0 to 1; 0 is a lost motor, which stops. Controllers are not told.
        """
        if not 0 <= i < len(self):
            raise CommandError(f"there is no UAV {i}; rows 0 to {len(self) - 1} exist")
        rotors = len(self.airframes[i].rotors.places)
        if not 0 <= rotor < rotors:
            raise CommandError(f"{self.names[i]} has no rotor {rotor}; 0 to {rotors - 1} exist")
        health = self._bodies["rotor_health"][i, :rotors].copy()
        health[rotor] = checked_within("rotor health", factor, (), 1.0)
        fit_rotors(self._bodies[i], self._models["plant"][self._uavs["model"][i]], health)
        self._bodies["ground_budget"][i] = 0.0

    # ------------------------------------------------------------------------------ contacts

    def crash(self, i: int) -> None:
        """Stop the rotors of UAV `i` for good."""
        self._bodies["crashed"][i] = True
        self._wake(i)
        pilot: Any = self._pilots[i]
        fresh = np.zeros(1, PILOT)[0]
        for name in ("home", "heading", "heading_target", "timeout_steps", "full_thrust"):
            fresh[name] = pilot[name]
        fresh["mode"] = FlightMode.CRASHED
        fresh["level"] = ControlLevel.STOPPED
        self._pilots[i] = fresh

    def strike(
        self,
        i: int,
        normal_map: ArrayLike,
        restitution: float = 0.3,
        friction: float = 0.5,
        *,
        point_map: ArrayLike | None = None,
    ) -> float:
        """Impulse on UAV `i` from something fixed that it touches; returns its size in N s.

        normal_map: (3,) unit vector out of what was touched. point_map: (3,) m, where; without it
        the impulse goes through the centre of mass. Nothing happens when the two part already.
        """
        return self._collide(i, None, normal_map, restitution, friction, point_map)

    def strike_pair(
        self,
        i: int,
        j: int,
        normal_map: ArrayLike,
        restitution: float = 0.3,
        friction: float = 0.5,
        *,
        point_map: ArrayLike | None = None,
    ) -> float:
        """Equal and opposite impulses on UAVs `i` and `j`; normal_map (3,) points from j to i."""
        return self._collide(i, j, normal_map, restitution, friction, point_map)

    # ------------------------------------------------------------------------------ snapshot

    def get_state(self) -> dict[str, Any]:
        """Copy of everything that changes: UAVs, history, step, events not yet drained."""
        return {
            "uavs": self._uavs.copy(),
            "position": self.history.position.copy(),
            "attitude": self.history.attitude.copy(),
            "step": self.step,
            "events": list(self._drained),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a `get_state` of this fleet; views handed out before stay valid."""
        self._uavs[...] = state["uavs"]
        self.history.position[...] = state["position"]
        self.history.attitude[...] = state["attitude"]
        self.step = state["step"]
        self._drained = list(state["events"])

    # -------------------------------------------------------------------------------- inside

    def _start_in_air(self, i: int) -> None:
        airframe = self.airframes[i]
        trim = np.sqrt(hover_thrusts(airframe) / airframe.rotors.thrust_n_s2)
        self._bodies["rotor_speed"][i, : len(trim)] = trim
        self._pilots["rotor_reference"][i, : len(trim)] = trim
        pilot = self._enter_guided(i, FlightMode.HOLD, from_ground=True)
        pilot["position_target"] = self._bodies["position_map"][i]
        pilot["braking"] = False

    def _refuse_wreck(self, i: int) -> None:
        if not 0 <= i < len(self):
            raise CommandError(f"there is no UAV {i}; rows 0 to {len(self) - 1} exist")
        if self._bodies["crashed"][i]:
            raise CommandError(f"{self.names[i]} has crashed")

    def _checked_thrust(self, i: int, thrust: float) -> float:
        airframe = self.airframes[i]
        most = len(airframe.rotors.places) * airframe.max_rotor_thrust
        return float(checked_within("thrust", thrust, (), most))

    def _wake(self, i: int) -> None:
        if self._bodies["on_ground"][i] or self._bodies["asleep"][i]:
            self._bodies["last_contact_step"][i] = self.step  # it stands: no new touch
        self._bodies["asleep"][i] = False
        self._bodies["still_steps"][i] = 0
        self._bodies["ground_budget"][i] = 0.0
        self._bodies["downwash_budget"][i] = 0.0

    def _enter_low_level(self, i: int, level: ControlLevel) -> Any:
        self._wake(i)
        pilot: Any = self._pilots[i]
        pilot["mode"] = FlightMode.LOW_LEVEL
        pilot["level"] = level
        return pilot

    def _enter_guided(self, i: int, mode: FlightMode, *, from_ground: bool = False) -> Any:
        self._refuse_wreck(i)
        if self.mode(i) is FlightMode.LANDED and not from_ground:
            raise CommandError(f"{self.names[i]} stands on the ground; it must take off first")
        self._wake(i)
        pilot: Any = self._pilots[i]
        if pilot["level"] != ControlLevel.GUIDED:
            body = self._bodies[i]
            yaw = float(rotations.yaw_of(body["attitude"]))
            pilot["level"] = ControlLevel.GUIDED
            pilot["velocity"] = body["velocity_map"]
            pilot["velocity_integral"] = 0.0
            pilot["heading"] = pilot["heading_target"] = math.cos(yaw), math.sin(yaw)
        if mode is not FlightMode.VELOCITY and pilot["turning"]:
            pilot["heading_target"] = pilot["heading"]
            pilot["turning"] = False
        pilot["mode"] = mode
        pilot["calm_ticks"] = 0
        return pilot

    def _command_velocity(self, i: int, velocity: ArrayLike, *, in_heading: bool) -> None:
        velocity = checked("velocity", velocity, (3,), 1e3)
        pilot = self._enter_guided(i, FlightMode.VELOCITY)
        pilot["velocity_target"] = velocity
        pilot["velocity_in_heading"] = in_heading
        pilot["deadline_step"] = self.step + pilot["timeout_steps"]

    def _turn(self, i: int, rate: Array) -> None:
        self._pilots["turning"][i] = True
        self._pilots["yaw_rate_target"][i] = rate

    def _face(self, i: int, yaw: float) -> None:
        self._pilots["turning"][i] = False
        self._pilots["heading_target"][i] = math.cos(yaw), math.sin(yaw)

    def _collide(
        self,
        i: int,
        j: int | None,
        normal_map: ArrayLike,
        restitution: float,
        friction: float,
        point_map: ArrayLike | None,
    ) -> float:
        normal = checked("normal", normal_map, (3,), 1.1)
        normal = normal / np.linalg.norm(normal)
        sides = [(i, 1.0)] if j is None else [(i, 1.0), (j, -1.0)]
        state = self.state
        velocity = np.zeros(3)
        softness = np.zeros((3, 3))
        spins: list[Array] = []
        for row, sign in sides:
            turn = rotations.matrix(state.attitude[row])
            airframe = self.airframes[row]
            lever = np.zeros(3)
            if point_map is not None:
                lever = np.asarray(point_map, dtype=np.float64) - state.position_map[row]
            cross = np.cross(np.eye(3), lever)  # cross @ f = lever x f
            inverse = turn @ np.diag(1.0 / np.array(airframe.body.inertia_kg_m2)) @ turn.T
            spins.append(turn.T @ inverse @ cross)
            softness += np.eye(3) / airframe.body.mass_kg - cross @ inverse @ cross
            omega = turn @ state.omega_body[row]
            velocity += sign * (state.velocity_map[row] + np.cross(omega, lever))
        closing = -float(velocity @ normal)
        if closing <= 0.0:
            return 0.0
        push = (1.0 + restitution) * closing / float(normal @ softness @ normal)
        impulse = push * normal
        across = velocity + closing * normal
        slide = float(np.linalg.norm(across))
        if slide > 1e-9:
            along = across / slide
            hold = min(friction * push, slide / float(along @ softness @ along))
            impulse = impulse - hold * along
        for (row, sign), spin in zip(sides, spins, strict=True):
            mass = self.airframes[row].body.mass_kg
            state.velocity_map[row] += sign * impulse / mass
            state.omega_body[row] += sign * (spin @ impulse)
            self._wake(row)
        return float(np.linalg.norm(impulse))


def _each(value: ArrayLike, count: int) -> ArrayLike:
    """One value a UAV, where one stands for all."""
    return value if np.ndim(value) else np.full(count, value)


def _check_wear(
    names: Sequence[str], airframes: Sequence[Airframe], worn: Sequence[tuple[RotorWear, ...]]
) -> None:
    if len(worn) != len(airframes):
        raise CommandError(f"wear is given for {len(worn)} UAVs, not {len(airframes)}")
    for name, airframe, wear in zip(names, airframes, worn, strict=True):
        if len(wear) not in (0, len(airframe.rotors.places)):
            raise CommandError(
                f"wear of {name} names {len(wear)} rotors; {airframe.name} has "
                f"{len(airframe.rotors.places)}"
            )


def _model_table(
    airframes: Sequence[Airframe], worn: Sequence[tuple[RotorWear, ...]], dt: float
) -> tuple[NDArray[np.void], list[int]]:
    """Distinct airframes and wears as `MODEL` rows, and each UAV's row.

    Gains are those of the new vehicle: controllers know nothing of wear.
    """
    kinds: dict[tuple[str, tuple[RotorWear, ...]], int] = {}
    distinct: list[tuple[Airframe, tuple[RotorWear, ...]]] = []
    rows = []
    for airframe, wear in zip(airframes, worn, strict=True):
        key = (airframe.model_dump_json(), wear)
        if key not in kinds:
            kinds[key] = len(distinct)
            distinct.append((airframe, wear))
        rows.append(kinds[key])
    models = np.zeros(len(distinct), MODEL)
    period = BATTERY_TICKS * steps_of(GUIDANCE_PERIOD_S, dt) * dt
    for row, (airframe, wear) in enumerate(distinct):
        models["plant"][row] = plant_of(airframe, dt, period, wear)[0]
        models["gains"][row] = gains_of(airframe, dt)[0]
    return models, rows


def _event(row: Any) -> FleetEvent:
    x, y, z = row["position"].tolist()
    return FleetEvent(
        _KINDS[int(row["kind"])],
        int(row["step"]),
        int(row["uav"]),
        (x, y, z),
        float(row["speed"]),
        FlightMode(int(row["mode"])),
        BatteryLevel(int(row["level"])),
    )
