"""Serves the playback of a log: `/volery/player/...` and services of the standard."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.core.errors import CommandError
from volery.runtime.services.features import PLAYER_FEATURES, offer_features
from volery.runtime.services.results import (
    Fields,
    Handler,
    RefusedError,
    ResultCode,
    filled,
    offer_command,
    offer_result,
)
from volery.runtime.services.simulation_state import WRONG_TRANSITION, RunState
from volery.runtime.services.worlds import OnLoad, offer_worlds

if TYPE_CHECKING:
    from volery.runtime.replay.playback_control import PlaybackControl
    from volery.scenario.catalog import ScenarioCatalog

_SRV = "simulation_interfaces/srv"
_OURS = "volery_interfaces"
_ALREADY_THERE = 101
_STATE = f"{_OURS}/msg/PlayerState"
_MAX_STEPS = 1_000_000_000


class PlayerServices:
    """Provides the services of one playback and publishes its state."""

    def __init__(
        self,
        player: PlaybackControl,
        on_load: OnLoad | None,
        catalog: ScenarioCatalog | None,
        on_close: Callable[[], None] | None = None,
    ) -> None:
        self._player = player
        self._on_close = on_close
        graph = player.graph
        self._state = graph.advertise("/volery/player/state", _STATE, latched=True)
        loads = on_load is not None
        offer_features(graph, loads_worlds=loads, offered=PLAYER_FEATURES)
        offer_worlds(graph, player.scenario, on_load, catalog)
        standard: tuple[tuple[str, str, Handler], ...] = (
            ("get_simulation_state", "GetSimulationState", self._get_state),
            ("set_simulation_state", "SetSimulationState", self._set_state),
            ("step_simulation", "StepSimulation", self._step),
        )
        for name, srvtype, handler in standard:
            offer_result(graph, f"/{name}", f"{_SRV}/{srvtype}", handler)
        ours: tuple[tuple[str, str, Handler], ...] = (
            ("set_speed", f"{_OURS}/srv/SetSpeed", self._set_speed),
            ("player/seek", f"{_OURS}/srv/Seek", self._seek),
            ("player/set_loop", "std_srvs/srv/SetBool", self._set_loop),
            ("player/info", f"{_OURS}/srv/PlayerInfo", self._info),
            ("player/close", "std_srvs/srv/Trigger", self._close),
        )
        for name, srvtype, handler in ours:
            offer_command(graph, f"/volery/{name}", srvtype, handler)

    def publish_state(self) -> None:
        """Publishes the playback state."""
        self._state.publish(filled(_STATE, self._present()))

    def _present(self) -> Fields:
        player = self._player
        return {
            "position": player.time_s,
            "start": player.start_s,
            "end": player.end_s,
            "state": int(player.state),
            "speed": player.speed or 0.0,
            "loop": player.loop,
            "can_close": self._on_close is not None,
        }

    def _get_state(self, _request: Any) -> Fields:
        state = {"state": int(self._player.state)}
        return {"state": filled("simulation_interfaces/msg/SimulationState", state)}

    def _set_state(self, request: Any) -> None:
        player, wanted = self._player, int(request.state.state)
        if wanted == player.state:
            raise RefusedError(_ALREADY_THERE, f"the player is {player.state.name} already")
        if wanted == RunState.PLAYING:
            player.resume()
        elif wanted == RunState.PAUSED:
            player.pause()
        elif wanted == RunState.STOPPED:
            player.pause()
            player.seek(player.start_s)
        elif wanted == RunState.QUITTING:
            player.quit()
        else:
            raise RefusedError(WRONG_TRANSITION, f"state {wanted} cannot be requested")

    def _step(self, request: Any) -> None:
        steps = int(request.steps)
        if not 1 <= steps <= _MAX_STEPS:
            reason = f"steps must be 1 to {_MAX_STEPS}, not {steps}"
            raise RefusedError(ResultCode.OPERATION_FAILED, reason)
        try:
            self._player.single_step(steps)
        except CommandError as error:
            raise RefusedError(ResultCode.INCORRECT_STATE, str(error)) from None

    def _set_speed(self, request: Any) -> None:
        self._player.set_speed(request.factor if request.factor > 0.0 else None)

    def _seek(self, request: Any) -> Fields:
        self._player.seek(request.time)
        return {"message": f"at {self._player.time_s:.3f} s"}

    def _set_loop(self, request: Any) -> None:
        self._player.loop = bool(request.data)
        self.publish_state()

    def _close(self, _request: Any) -> Fields:
        if self._on_close is None:
            raise CommandError("this process plays one log; Ctrl-C ends it")
        self._on_close()
        return {"message": f"{self._player.name} is closed"}

    def _info(self, _request: Any) -> Fields:
        fields = {**self._present(), **self._player.describe()}
        return {**fields, "counts": np.array(fields["counts"], np.uint64)}
