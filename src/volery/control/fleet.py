"""A fleet of UAVs: accepts commands, advances time, holds the state and collects events.

`Fleet` owns all state of plants and controllers as rows of arrays, which the compiled step
(`control.fused_step`) updates. The step handles ground and air; the engine handles trees and other
UAVs: it computes clearances, fills the budgets and calls `strike`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control import impulses
from volery.control.commands import FleetCommands
from volery.control.divided_step import (
    StepPart,
    StepResult,
    advance_in_parts,
    is_worth_dividing,
)
from volery.control.estimator.errors import EstimationError
from volery.control.fleet_events import FleetEvent, event_of
from volery.control.fleet_rows import (
    as_bytes,
    checked_modes,
    checked_plants,
    new_uavs,
    one_each,
    restarted_rows,
    shifted_rows,
)
from volery.control.fleet_variation import FleetParameters, FleetVariation
from volery.control.flight_modes import FlightMode
from volery.control.flying_start import FlyingStart, set_motion
from volery.control.fused_step import EVENT, EVENTS_A_STEP, advance_fleet
from volery.control.gains import STANDARD_RATES, ControlRates
from volery.control.model_table import (
    checked_wear,
    copy_references,
    model_table,
    new_references,
)
from volery.control.setpoints import (
    CONTROL_STATE,
    MAX_COORDINATE,
    ControlLevel,
    checked,
    checked_attitude,
    checked_within,
)
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, s_from_ns
from volery.core.errors import CommandError
from volery.core.rows import Rows
from volery.core.workers import Workers
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import Airframe, hover_thrusts
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.contact import steepest_cosine
from volery.vehicle.downwash import new_jets
from volery.vehicle.fleet import (
    FleetState,
    RotorTurns,
    charge_battery,
    fit_rotors,
    state_of,
)
from volery.vehicle.plant_types import RIGID_BODY, Plant, RigidBody
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.terrain import TerrainGrid
from volery.world.weather import CALM, Gust, Weather
from volery.world.weather.dryden import new_turbulence
from volery.world.weather.table import air_of
from volery.world.weather.wind_field import nodes_of

DEFAULT_TIMEOUT_S = 0.5
"""Time after which a velocity command without successor ends in HOLD, s."""
_MAX_STEP_NS = 5_000_000


class Fleet(FleetCommands):
    """N UAVs that are simulated in lock step.

    airframes: one per UAV. position_map: (N, 3) m. attitude: (N, 4) unit quaternions, map from
    body. dt_ns: physics step. on_contact: effect of an impact, "crash" (rotors stop, the UAV falls
    and rests) or "bounce" (the UAV rebounds and flies on). mode: `HOLD` starts in the air with
    rotors turning, `LANDED` on the ground with rotors stopped; one for all or one per UAV. names:
    for messages and, with `seed`, the random streams. control: rates of the control layers. plants:
    models of motion (`vehicle.plant_types`), one for all or one per UAV. weather: the initial
    weather; `set_weather` changes it. wear: of each rotor, for each UAV; empty means new.
    battery_charge: fractions from 0 to 1, one for all or one per UAV. copies: (N,) integers; UAVs
    of different copies of a scenario do not affect each other's air.

    Rows are numbered from 0. After `advance` the state belongs to time `step * dt_ns`. Raises
    `CommandError` for invalid arguments and `DataFileError` if `dt_ns` is too long for a vehicle.
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
        control: ControlRates = STANDARD_RATES,
        plants: Plant | Sequence[Plant] = RigidBody(),  # noqa: B008  (frozen)
        weather: Weather = CALM,
        seed: int = 0,
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
        modes = checked_modes(mode, count)
        plants = checked_plants(plants, count)

        names = tuple(names or (f"UAV {i}" for i in range(count)))
        worn = checked_wear(names, airframes, wear)
        charge = checked_within("battery_charge", one_each(battery_charge, count), (count,), 1.0)
        dt = dt_ns / NS_PER_S
        self._models, rows = model_table(airframes, plants, worn, dt, control)
        self._shared_models = self._models
        uavs = new_uavs(position, attitude, rows, copies, seed, names)
        super().__init__(tuple(airframes), plants, names, uavs, dt)
        self._jets = new_jets(count)
        self._all_rigid = bool((self._models["kind"] == RIGID_BODY).all())
        self._dt_ns = int(dt_ns)
        self._bounce = on_contact == "bounce"
        self._periods = (
            control.guidance_steps(dt),
            control.attitude_steps(dt),
            control.air_steps(dt),
        )
        self._events = np.zeros(max(256, 2 * EVENTS_A_STEP * count), EVENT)
        self._drained: list[FleetEvent] = []
        self._grid: TerrainGrid | None = None
        self._ground: tuple[Array, float, float, float, float] | None = None
        self._weather = weather
        self._air = air_of(weather)
        self._air_nodes = nodes_of(weather.field)
        self._variation: FleetVariation | None = None
        self.state: FleetState = state_of(self._bodies)
        self.history: PoseHistory = new_history(position, attitude, self._dt_ns)
        self.set_command_timeout(DEFAULT_TIMEOUT_S)
        self._fit_out(worn, charge)
        self._begin(modes)

    @property
    def dt_ns(self) -> int:
        """Physics step, ns."""
        return self._dt_ns

    @property
    def guidance_period_ns(self) -> int:
        """Period of updates of the air, a multiple of the guidance tick, ns."""
        return self._periods[2] * self._dt_ns

    @property
    def s_to_next_tick(self) -> float:
        """Time from a guidance tick to the next one, s; 0 between two ticks."""
        is_tick = self.step % self._periods[0] == 0
        return s_from_ns(self._periods[0] * self._dt_ns) if is_tick else 0.0

    @property
    def common_period_ns(self) -> int:
        """Period after which control, air and batteries are updated together again, ns."""
        has_battery = any(airframe.battery is not None for airframe in self.airframes)
        batteries = self._periods[0] * (BATTERY_TICKS if has_battery else 1)
        return math.lcm(*self._periods, batteries) * self._dt_ns

    @property
    def time_ns(self) -> int:
        """Time since the start, ns."""
        return self.step * self._dt_ns

    def rotor_turns(self) -> RotorTurns:
        """Returns rotor angles and speeds, valid for some milliseconds around the present."""
        ticks = -(-self.step // self._periods[0])  # angles are those of the end of the tick
        angle, speed = self.state.rotor_angle.copy(), self.state.rotor_speed.copy()
        return RotorTurns(angle, speed, ticks * self._periods[0] * self._dt_ns)

    # ---------------------------------------------------------------------------------- time

    def advance(
        self,
        steps: int,
        terrain: TerrainGrid,
        *,
        event_ends: bool = False,
        workers: Workers | None = None,
    ) -> int:
        """Runs up to `steps` physics steps; returns the number done.

        The number is smaller when a UAV has used up its `contact_budget` or `separation_budget`,
        or, with `event_ends`, after an event. `advance(0, ...)` compiles the step. workers: threads
        that share the UAVs of a large fleet; the results are those of one thread.
        """
        if terrain is not self._grid or self._ground is None:
            self._ground = self._ground_of(terrain)
        done = 0
        while True:
            part = StepPart(self.step, steps - done, 0, len(self), self._events)
            if workers is None or not is_worth_dividing(workers, len(self)):
                result = self._advance_part(part, event_ends)
            else:
                result = advance_in_parts(
                    lambda own: self._advance_part(own, event_ends), part, self._periods, workers
                )
            self.step += result.steps
            done += result.steps
            if result.written:
                self._drained += [event_of(row) for row in self._events[: result.written]]
            if result.spent or done >= steps or (event_ends and result.written):
                return done

    def _advance_part(self, part: StepPart, event_ends: bool) -> StepResult:
        """Advances some UAVs by some steps."""
        assert self._ground is not None
        return StepResult(
            *advance_fleet(
                self._uavs,
                self._models,
                self._jets,
                *self._ground,
                self.history.position,
                self.history.attitude,
                self._paths.rows,
                None if self._all_rigid else self._references,
                self._air,
                self._air_nodes,
                part.events,
                part.step,
                part.steps,
                *self._periods,
                self._dt,
                self._bounce,
                event_ends,
                part.first,
                part.last,
                part.calm,
                part.look,
            )
        )

    @property
    def has_events(self) -> bool:
        """Whether there are events since the last `drain_events`."""
        return bool(self._drained)

    def drain_events(self) -> list[FleetEvent]:
        """Returns the events since the last call, in order of step, then row."""
        events, self._drained = self._drained, []
        return events

    def _ground_of(self, terrain: TerrainGrid) -> tuple[Array, float, float, float, float]:
        self._grid = terrain
        self._bodies["ground_budget"] = 0.0
        return (
            # a copy: numba determines the type of a writable array faster
            np.array(terrain.heights, dtype=np.float64, order="C"),
            float(terrain.origin_x),
            float(terrain.origin_y),
            float(terrain.spacing),
            steepest_cosine(terrain),
        )

    # ----------------------------------------------------------------------------------- air

    @property
    def weather(self) -> Weather:
        """Weather around the UAVs."""
        return self._weather

    def set_weather(self, weather: Weather) -> None:
        """Sets the weather from the next guidance tick on (125 Hz)."""
        if weather.field is not self._weather.field:
            self._air_nodes = nodes_of(weather.field)
        self._weather = weather
        self._refresh_air()

    def add_gust(self, gust: Gust) -> None:
        """Adds a gust to the weather."""
        self.set_weather(self._weather.with_gust(gust, s_from_ns(self.time_ns)))

    def set_rotor_health(self, i: int, rotor: int, factor: float) -> None:
        """Sets the thrust of rotor number `rotor` of UAV `i` to `factor` of a new one's.

        From 0 to 1; 0 is a failed motor, which stops. Controllers do not know the factor. Raises
        `CommandError` for an unknown UAV or rotor, or a factor out of range.
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

    def vary(self, rows: NDArray[np.int64], parameters: FleetParameters) -> None:
        """Changes physical parameters of the UAVs `rows` (K,).

        Winds change at the next update of the air, models at the next step, rotor thrusts at the
        next restart. Raises `CommandError` for models that are no rigid bodies.
        """
        variation = self._own_variation()
        if parameters.changes_model:
            variation.set_models(self._own_models(), rows, parameters)
        if parameters.changes_air:
            had_air = variation.has_air
            variation.set_air(rows, parameters)
            if had_air:
                variation.write_air(self._air, rows)
            else:
                self._refresh_air()

    def _own_variation(self) -> FleetVariation:
        if self._variation is None:
            self._variation = FleetVariation(self.airframes, self._uavs, self._dt)
        return self._variation

    def _own_models(self) -> NDArray[np.void]:
        """Returns the table of models with a row for each UAV."""
        if self._models is self._shared_models:
            self._models = self._shared_models[self._uavs["model"]]
            self._uavs["model"] = np.arange(len(self))
        return self._models

    def _refresh_air(self) -> None:
        self._air = air_of(self._weather)
        if self._variation is not None and self._variation.has_air:
            self._air = self._variation.air_of(self._air)

    def set_estimation_error(self, rows: Rows | slice, error: EstimationError) -> None:
        """Sets the estimation errors with which the controllers of the UAVs `rows` fly."""
        belief = self._uavs["belief"]
        belief["position_error"][rows] = error.position_map
        belief["velocity_error"][rows] = error.velocity_map
        belief["rotation_error"][rows] = error.rotation_map
        belief["rate_error"][rows] = error.omega_body
        self._control_states["errs"][rows] = True

    def displace(self, i: int, offset: ArrayLike) -> None:
        """Shifts UAV `i` by `offset` (3,) m, map, at once; its motion is unchanged."""
        offset = checked("offset", offset, (3,), MAX_COORDINATE)
        self._bodies["position_map"][i] += offset
        self._bodies["contact_budget"][i] = 0.0
        self._bodies["separation_budget"][i] = 0.0
        self._wake(i)

    def put(self, i: int, position: ArrayLike, attitude: ArrayLike, *, in_air: bool = True) -> None:
        """Sets the pose of UAV `i`: (3,) m, map; (4,) map from body. Its motion is unchanged.

        A flying UAV then holds there; a landed one hovers if `in_air`. A crashed UAV remains
        crashed.
        """
        position = checked("position", position, (3,), MAX_COORDINATE)
        attitude = checked_attitude(attitude)
        self._bodies["position_map"][i] = self.history.position[:, i] = position
        self._bodies["attitude"][i] = self.history.attitude[:, i] = attitude
        self._bodies["contact_budget"][i] = 0.0
        self._bodies["separation_budget"][i] = 0.0
        self._restart(i, in_air)
        if in_air:
            self._bodies["on_ground"][i] = False

    def rest(self, i: int) -> None:
        """Lets the landed UAV `i` rest where it stands, without motion, until the next command."""
        for name in ("velocity_map", "omega_body", "acceleration_map", "angular_acceleration_body"):
            self._bodies[name][i] = 0.0
        self._bodies["on_ground"][i] = self._bodies["asleep"][i] = True

    def push(self, i: int, velocity: ArrayLike, omega_body: ArrayLike) -> None:
        """Sets the velocity (3,) m/s, map, and rates (3,) rad/s, FLU, of UAV `i`.

        A flying UAV then brakes and holds.
        """
        velocity = checked("velocity", velocity, (3,), 100.0)
        omega_body = checked("rates", omega_body, (3,), 100.0)
        self._bodies["velocity_map"][i] = velocity
        self._bodies["omega_body"][i] = omega_body
        self._restart(i, in_air=False)

    # ------------------------------------------------------------------------------ contacts

    def crash(self, i: int) -> None:
        """Marks UAV `i` as crashed and stops its rotors for good."""
        self._bodies["crashed"][i] = True
        self._wake(i)
        control_state: Any = self._control_states[i]
        fresh = np.zeros(1, CONTROL_STATE)[0]
        for name in ("home", "heading", "heading_target", "timeout_steps", "full_thrust"):
            fresh[name] = control_state[name]
        fresh["mode"] = FlightMode.CRASHED
        fresh["level"] = ControlLevel.STOPPED
        self._control_states[i] = fresh

    def strike(
        self,
        i: int,
        normal_map: ArrayLike,
        restitution: float = 0.3,
        friction: float = 0.5,
        *,
        other: int | None = None,
        point_map: ArrayLike | None = None,
    ) -> float:
        """Applies the impulse of a contact to UAV `i`; returns its size, N s.

        normal_map: (3,) unit vector out of the fixed object, or out of the `other` UAV, which gets
        the opposite impulse. point_map: (3,) m, the contact; None: the impulse acts at the centre
        of mass. The impulse is 0 if the two already separate.
        """
        size = impulses.collide(
            self.airframes, self.state, i, other, normal_map, restitution, friction, point_map
        )
        if size > 0.0:
            for row in (i,) if other is None else (i, other):
                self._wake(row)
        return size

    # ------------------------------------------------------------------------------ snapshot

    def get_state(self) -> dict[str, Any]:
        """Returns copies of all variable state: UAVs, history, step, weather, pending events."""
        return {
            "uavs": self._uavs.copy(),
            "position": self.history.position.copy(),
            "attitude": self.history.attitude.copy(),
            "step": self.step,
            "references": self._references.copy(),
            "paths": self._paths.get_state(),
            "weather": self._weather,
            "events": list(self._drained),
            "variation": None if self._variation is None else self._variation.get_state(),
            "models": None if self._models is self._shared_models else self._models.copy(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a `get_state` of this fleet; existing views remain valid."""
        self._uavs[...] = state["uavs"]
        self.history.position[...] = state["position"]
        self.history.attitude[...] = state["attitude"]
        self._references[...] = state["references"]
        self._paths.set_state(state["paths"])
        self.step = state["step"]
        self._set_variation(state)
        self.set_weather(state["weather"])
        self._drained = list(state["events"])

    def restore(self, state: dict[str, Any], rows: NDArray[np.int64]) -> None:
        """Restores the UAVs `rows` (K,) alone from a `get_state` of this fleet.

        Their times shift to the present step. Raises `CommandError` if one followed a trajectory.
        """
        if (state["uavs"]["control_state"]["path_last"][rows] >= 0).any():
            raise CommandError("UAVs that follow trajectories are restored with the whole fleet")
        shift = self.step - state["step"]
        fresh = shifted_rows(state["uavs"], rows, shift, shift // self._periods[2])
        fresh["model"] = self._uavs["model"][rows]
        as_bytes(self._uavs)[rows] = as_bytes(fresh)
        for ring, saved in (
            (self.history.position, state["position"]),
            (self.history.attitude, state["attitude"]),
        ):
            ring[:, rows] = np.roll(saved, shift, axis=0)[:, rows]
        if len(self._references) == len(self):
            self._references[rows] = np.roll(state["references"], shift, axis=1)[rows]
        self._restore_variation(state, rows)

    def _restore_variation(self, state: dict[str, Any], rows: NDArray[np.int64]) -> None:
        kept, models = state["variation"], state["models"]
        if self._variation is None and kept is None:
            return
        if models is not None or self._models is not self._shared_models:
            own = (
                self._shared_models[state["uavs"]["model"][rows]]
                if models is None
                else models[rows]
            )
            self._own_models()[rows] = own
        self._own_variation().restore(kept, rows)
        self._refresh_air()

    def seed_turbulence(self, seed: int, rows: NDArray[np.int64], names: Sequence[str]) -> None:
        """Gives the UAVs `rows` the turbulence of UAVs with `names` in a run with `seed`."""
        self._uavs["turbulence"]["key"][rows] = new_turbulence(seed, names)["key"]

    @property
    def has_turbulence(self) -> bool:
        """Whether the air around any UAV is turbulent."""
        return bool((self._air["w20"] > 0.0).any())

    def set_turbulence_keys(self, rows: NDArray[np.int64], keys: NDArray[np.uint64]) -> None:
        """Sets the random streams (K,) of the turbulence around the UAVs `rows` (K,)."""
        self._uavs["turbulence"]["key"][rows] = keys

    def restart(
        self,
        start: dict[str, Any],
        rows: NDArray[np.int64],
        start_rows: NDArray[np.int64] | None = None,
    ) -> None:
        """Resets the UAVs `rows` (K,) to their state in `start`, a state at step 0.

        A UAV's own time, which wind and timeouts use, restarts; the random stream of its turbulence
        is unchanged. start_rows: (K,) rows in `start`, None for the same. Model numbers may differ
        there.
        """
        start_rows = rows if start_rows is None else start_rows
        self._restart_rows(start, rows, start_rows)
        self._set_past(rows, start["position"][0, start_rows], start["attitude"][0, start_rows])

    def _restart_rows(
        self, start: dict[str, Any], rows: NDArray[np.int64], start_rows: NDArray[np.int64]
    ) -> None:
        """Does what `restart` does, apart from the pose history."""
        air_tick = self.step // self._periods[2]
        fresh = restarted_rows(start["uavs"], start_rows, self.step, air_tick)
        fresh["model"] = self._uavs["model"][rows]
        fresh["turbulence"]["key"] = self._uavs["turbulence"]["key"][rows]
        as_bytes(self._uavs)[rows] = as_bytes(fresh)
        if len(self._references) == len(self):
            self._references[rows, :] = start["references"][start_rows, :1]
        if self._variation is not None:
            self._variation.fit(self._models, rows)

    def _set_past(self, rows: NDArray[np.int64], position: Array, attitude: Array) -> None:
        """Lets the UAVs `rows` (K,) have been at rest in poses (K, 3) and (K, 4) so far."""
        is_all = np.array_equal(rows, np.arange(len(self)))
        chosen = slice(None) if is_all else rows  # numpy copies slices much faster
        self.history.position[:, chosen] = position
        self.history.attitude[:, chosen] = attitude

    def restart_in_flight(
        self, start: dict[str, Any], rows: NDArray[np.int64], motion: FlyingStart
    ) -> None:
        """Resets the UAVs `rows` (K,), but with another motion.

        start: a state at step 0 in which the UAVs hold in the air.
        """
        self._restart_rows(start, rows, rows)
        set_motion(self._uavs, rows, motion)
        self._set_past(rows, motion.position_map, motion.attitude)
        if len(self._references) == len(self):
            self._references[rows, :, :4] = motion.attitude[:, None]

    def continue_from(self, other: Fleet, pairs: Sequence[tuple[int, int]]) -> None:
        """Continues from another fleet, with UAVs of it and new ones.

        This fleet must not have advanced yet. pairs: own row and the other's of each UAV that
        continues; all others start now.
        """
        start = self.get_state()
        self.step = other.step
        self.set_weather(other.weather)
        own, theirs = np.array(pairs, np.int64).reshape(-1, 2).T
        self.restart(start, np.setdiff1d(np.arange(len(self)), own))
        going_on = other._uavs[theirs].copy()
        going_on["model"] = self._uavs["model"][own]
        self._uavs[own] = going_on
        self._bodies["downwash_budget"] = 0.0  # downwash pairs are searched again
        self.history.position[:, own] = other.history.position[:, theirs]
        self.history.attitude[:, own] = other.history.attitude[:, theirs]
        self._paths.continue_from(other._paths, pairs)
        if len(self._references) == len(self) and len(other._references) == len(other):
            copy_references(other._references[theirs], self._references, own, self.step)

    # -------------------------------------------------------------------------------- inside

    def _set_variation(self, state: dict[str, Any]) -> None:
        """Restores the differences between UAVs; a state may be from before the first."""
        kept, models = state.get("variation"), state.get("models")
        self._models = self._shared_models if models is None else models.copy()
        if kept is None:
            self._variation = None
            return
        self._own_variation().set_state(kept)

    def _fit_out(self, worn: Sequence[tuple[RotorWear, ...]], charge: Array) -> None:
        """Applies the wear of rotors and the charge of batteries."""
        for i, row in enumerate(self._uavs["model"]):
            plant = self._models["plant"][row]
            health = [rotor.thrust for rotor in worn[i]] or np.ones(int(plant["rotors"]))
            fit_rotors(self._bodies[i], plant, health)
            charge_battery(self._bodies[i], plant, float(charge[i]))
            self._control_states["full_thrust"][i] = self.airframes[i].max_rotor_thrust

    def _begin(self, modes: Sequence[FlightMode]) -> None:
        """Sets the first modes and the homes of the UAVs at their positions."""
        flying = np.array([mode is FlightMode.HOLD for mode in modes])
        weight = np.array([airframe.weight for airframe in self.airframes])
        attitude = self._bodies["attitude"]
        self._references = new_references(self._models, attitude, weight * flying)
        self._control_states["home"] = self._bodies["position_map"]
        self._bodies["last_contact_step"][~flying] = 0
        for i in np.flatnonzero(flying):
            self._start_in_air(int(i))

    def _restart(self, i: int, in_air: bool) -> None:
        """Restarts the controllers of UAV `i` from its present motion."""
        self._wake(i)
        if self._bodies["crashed"][i]:
            return
        if self.mode(i) is not FlightMode.LANDED:
            self._control_states["level"][i] = ControlLevel.STOPPED
            self._enter_guided(i, FlightMode.HOLD)["braking"] = True
        elif in_air:
            self._start_in_air(i)
        if len(self._references) == len(self):
            self._references[i, :, :4] = self._bodies["attitude"][i]

    def _start_in_air(self, i: int) -> None:
        airframe = self.airframes[i]
        trim = np.sqrt(hover_thrusts(airframe) / airframe.rotors.thrust_n_s2)
        self._bodies["rotor_speed"][i, : len(trim)] = trim
        self._control_states["rotor_reference"][i, : len(trim)] = trim
        control_state = self._enter_guided(i, FlightMode.HOLD, from_ground=True)
        control_state["thrust"] = airframe.weight
        control_state["position_target"] = self._bodies["position_map"][i]
