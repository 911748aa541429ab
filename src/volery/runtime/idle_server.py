"""Serves clients while no world is loaded: a graph with the services that need none."""

from __future__ import annotations

from typing import Any

from volery.engine.command_queue import CommandQueue
from volery.graph.graph import Graph
from volery.graph.session import Gateway
from volery.runtime.services.features import offer_features
from volery.runtime.services.results import Fields, RefusedError, filled, offer_result
from volery.runtime.services.simulation_state import WRONG_TRANSITION, RunState
from volery.runtime.services.worlds import OnLoad, offer_worlds
from volery.scenario.catalog import ScenarioCatalog

_SRV = "simulation_interfaces/srv"


class IdleServer:
    """Serves the bridges between two simulations, in the state NO_WORLD.

    Clients can request features, state and worlds, load a world, or quit. Its owner calls `wait`
    until `on_load` is called or `quitting` is set.
    """

    scenario = geometry = operators = None
    waits_at_end = False

    def __init__(self, on_load: OnLoad, catalog: ScenarioCatalog | None = None) -> None:
        self.quitting = False
        self._inbox = CommandQueue()
        self.graph = Graph(lambda: 0, self._inbox.post)
        self.gateway = Gateway(self.graph, self._inbox.post)
        offer_features(self.graph, loads_worlds=True)
        offer_worlds(self.graph, None, on_load, catalog)
        get, put = f"{_SRV}/GetSimulationState", f"{_SRV}/SetSimulationState"
        offer_result(self.graph, "/get_simulation_state", get, self._get_state)
        offer_result(self.graph, "/set_simulation_state", put, self._set_state)

    def wait(self, timeout_s: float) -> None:
        """Serves clients for a wall time, s, or until the next request."""
        self._inbox.wait(timeout_s)
        self._inbox.work_off()
        self.graph.deliver()

    def _get_state(self, _request: Any) -> Fields:
        state = RunState.QUITTING if self.quitting else RunState.NO_WORLD
        return {"state": filled("simulation_interfaces/msg/SimulationState", {"state": int(state)})}

    def _set_state(self, request: Any) -> None:
        if int(request.state.state) != RunState.QUITTING:
            raise RefusedError(WRONG_TRANSITION, "no world is loaded; load one, or quit")
        self.quitting = True
