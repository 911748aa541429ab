"""Plays, pauses, stops, quits and resets a simulation, by the standard."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

from volery.core.errors import SnapshotError
from volery.graph.graph import Graph
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.facets.clock import SimulationClock
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.replay.command_effects import CONTINUE_RUN
from volery.runtime.services.results import (
    Fields,
    RefusedError,
    ResultCode,
    filled,
    offer_command,
    offer_result,
)

_SRV = "simulation_interfaces/srv"
_ALREADY_THERE = 101
_TRANSITION_FAILED = 102
WRONG_TRANSITION = 103
_TIME, _STATE, _SPAWNED, _ALL = 1, 2, 4, 255


class RunState(IntEnum):
    """Enumerates `simulation_interfaces/msg/SimulationState`."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3
    NO_WORLD = 4
    LOADING_WORLD = 5


class SimulationStateServices:
    """Serves the state of a simulation; stopped means paused at the start, after a reset.

    reset: returns the simulation to its start.
    """

    def __init__(
        self,
        graph: Graph,
        clock: SimulationClock,
        vehicles: SimulationVehicles,
        end: EndOfRun,
        reset: Callable[[], None],
    ) -> None:
        self._graph = graph
        self._clock = clock
        self._vehicles = vehicles
        self._end = end
        self._reset_all = reset
        self._stopped = False

    def offer(self) -> None:
        """Creates the services of the simulation's state."""
        for name, srvtype, handler in (
            ("get_simulation_state", "GetSimulationState", self._get),
            ("set_simulation_state", "SetSimulationState", self._set),
            ("reset_simulation", "ResetSimulation", self._reset),
        ):
            offer_result(self._graph, f"/{name}", f"{_SRV}/{srvtype}", handler)
        offer_command(self._graph, CONTINUE_RUN, "std_srvs/srv/Trigger", self._continue)

    def _continue(self, _request: Any) -> Fields:
        self._end.fly_on()
        return {"message": "the flight continues past the scenario's end"}

    @property
    def state(self) -> RunState:
        """Present state."""
        if self._clock.quitting:
            return RunState.QUITTING
        if not self._clock.paused:
            return RunState.PLAYING
        at_start = self._stopped and self._graph.now_ns() == 0
        return RunState.STOPPED if at_start else RunState.PAUSED

    def _get(self, _request: Any) -> Fields:
        state = {"state": int(self.state)}
        return {"state": filled("simulation_interfaces/msg/SimulationState", state)}

    def _set(self, request: Any) -> None:
        wanted, state = int(request.state.state), self.state
        if wanted == state:
            raise RefusedError(_ALREADY_THERE, f"the simulation is {state.name} already")
        if state is RunState.QUITTING:
            raise RefusedError(WRONG_TRANSITION, "the simulation is quitting")
        if wanted == RunState.PLAYING:
            if self._end.waits:
                raise RefusedError(WRONG_TRANSITION, self._end.notice)
            self._stopped = False
            self._clock.resume()
        elif wanted == RunState.PAUSED:
            if state is RunState.STOPPED:
                raise RefusedError(WRONG_TRANSITION, "it is stopped; play it, then pause it")
            self._clock.pause()
        elif wanted == RunState.STOPPED:
            self._stop()
        elif wanted == RunState.QUITTING:
            self._clock.quit()
        else:
            raise RefusedError(WRONG_TRANSITION, f"state {wanted} cannot be requested")

    def _stop(self) -> None:
        try:
            self._reset_all()
        except SnapshotError as error:
            raise RefusedError(_TRANSITION_FAILED, str(error)) from None
        self._stopped = True
        self._clock.pause()

    def _reset(self, request: Any) -> None:
        """Resets time and state together, and deletes spawned UAVs."""
        scope = int(request.scope)
        if scope != _ALL and scope & ~(_TIME | _STATE | _SPAWNED):
            raise RefusedError(ResultCode.OPERATION_FAILED, f"there is no scope {scope}")
        if scope == _SPAWNED:
            self._vehicles.delete_spawned()
            return
        if scope not in (0, _ALL) and not (scope & _TIME and scope & _STATE):
            reason = "time and state are reset together: SCOPE_DEFAULT, SCOPE_ALL, or both bits"
            raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, reason)
        if scope == _TIME | _STATE and self._vehicles.spawned:
            reason = "a reset deletes spawned UAVs: add SCOPE_SPAWNED, or delete them first"
            raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, reason)
        self._reset_all()
