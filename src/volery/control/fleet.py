"""A fleet of UAVs: give commands, advance time, read the state, collect what happened.

`Fleet` owns all state of plants and controllers as rows of arrays; the compiled step
(`control.step`) does the work. It knows the ground and the wind; trees and other UAVs are the
engine's business, which looks up clearances, fills the budgets and calls `strike`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control import impulses
from volery.control.commands import FleetCommands
from volery.control.fleet_events import FleetEvent, event_of
from volery.control.flight_modes import FlightMode
from volery.control.gains import ATTITUDE_PERIOD_S, GUIDANCE_PERIOD_S, steps_of
from volery.control.model_table import model_table, new_references
from volery.control.setpoints import (
    MAX_COORDINATE,
    PILOT,
    ControlLevel,
    checked,
    checked_attitude,
    new_pilots,
)
from volery.control.step import EVENT, EVENTS_A_STEP, UAV, advance_fleet
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.vehicle.airframe import Airframe, hover_thrusts
from volery.vehicle.contact import steepest_cosine
from volery.vehicle.fleet import FleetState, new_bodies, state_of
from volery.vehicle.plants import Plant, RigidBody
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.terrain import TerrainGrid

Array = NDArray[np.float64]

DEFAULT_TIMEOUT_S = 0.5
"""s after which a velocity command without successor ends in HOLD."""
_MAX_STEP_NS = 5_000_000


class Fleet(FleetCommands):
    """N UAVs that fly in lock step.

    airframes: one a UAV. position_map: (N, 3) m. attitude: (N, 4) unit quaternions, map from body.
    dt_ns: physics step. on_contact: what an impact does, "crash" (rotors stop, it falls and rests)
    or "bounce" (it rebounds and flies on). mode: `HOLD` starts in the air with rotors turning,
    `LANDED` on the ground with rotors stopped; one for all or one a UAV. names: for messages.
    plants: what turns commands into motion (`vehicle.plants`), one for all or one a UAV.

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
        plants: Plant | Sequence[Plant] = RigidBody(),  # noqa: B008  (frozen)
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

        plants = tuple(plants) if isinstance(plants, Sequence) else (plants,) * count
        if len(plants) != count:
            raise CommandError(f"there are {len(plants)} plants for {count} UAVs")

        models, rows = model_table(airframes, plants, dt_ns / NS_PER_S)
        uavs = np.zeros(count, UAV)
        uavs["body"] = new_bodies(position, attitude)
        uavs["pilot"] = new_pilots(attitude)
        uavs["model"] = rows
        names = tuple(names or (f"UAV {i}" for i in range(count)))
        super().__init__(tuple(airframes), plants, names, uavs, dt_ns / NS_PER_S)
        self._models = models
        weight = np.array([airframe.weight for airframe in airframes])
        flying = np.array([start is FlightMode.HOLD for start in modes])
        self._references = new_references(models, attitude, weight * flying)
        self._dt_ns = int(dt_ns)
        self._bounce = on_contact == "bounce"
        self._periods = (
            steps_of(GUIDANCE_PERIOD_S, self._dt),
            steps_of(ATTITUDE_PERIOD_S, self._dt),
        )
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
                *self._ground,
                self.history.position,
                self.history.attitude,
                float(wx),
                float(wy),
                float(wz),
                self._paths.rows,
                self._references,
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
                self._drained += [event_of(row) for row in self._events[:written]]
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

    # ------------------------------------------------------------------------------ contacts

    def crash(self, i: int) -> None:
        """Stop the rotors of UAV `i` for good."""
        self._bodies["crashed"][i] = True
        self._wake(i)
        pilot: Any = self._pilots[i]
        fresh = np.zeros(1, PILOT)[0]
        for name in ("home", "heading", "heading_target", "timeout_steps"):
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
            "references": self._references.copy(),
            "paths": self._paths.get_state(),
            "events": list(self._drained),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a `get_state` of this fleet; views handed out before stay valid."""
        self._uavs[...] = state["uavs"]
        self.history.position[...] = state["position"]
        self.history.attitude[...] = state["attitude"]
        self._references[...] = state["references"]
        self._paths.set_state(state["paths"])
        self.step = state["step"]
        self._drained = list(state["events"])

    # -------------------------------------------------------------------------------- inside

    def _start_in_air(self, i: int) -> None:
        airframe = self.airframes[i]
        trim = np.sqrt(hover_thrusts(airframe) / airframe.rotors.thrust_n_s2)
        self._bodies["rotor_speed"][i, : len(trim)] = trim
        self._pilots["rotor_reference"][i, : len(trim)] = trim
        pilot = self._enter_guided(i, FlightMode.HOLD, from_ground=True)
        pilot["thrust"] = airframe.weight
        pilot["position_target"] = self._bodies["position_map"][i]

    def _collide(self, i: int, j: int | None, normal_map: ArrayLike, *how: Any) -> float:
        size = impulses.collide(self.airframes, self.state, i, j, normal_map, *how)
        if size > 0.0:
            for row in (i,) if j is None else (i, j):
                self._wake(row)
        return size
