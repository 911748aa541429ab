"""Flies the scenario `v_formation` and follows what its node publishes."""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.core.errors import WaitTimeoutError
from volery.graph.messages import Published
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

_TOPIC = "/v_formation/status"
_TAKE_OFF_S, _FORM_S, _RECOVER_S = 180.0, 180.0, 120.0
_LOST = 0.1
"""Cost of a formation below which it counts as a V, as for the node."""


@dataclass
class FormationFlight:
    """Describes a flight into a V; times are s, NaN where it did not happen."""

    time_to_v_s: float
    """From the take-off's end to the V, with flying to the random starts."""
    recovery_s: float
    """From the loss of UAVs to the V of the others."""
    min_distance_m: float
    """Between two UAVs in the air."""
    real_time_factor: float
    """Until the V."""


def fly(seed: int, uavs: int, lost: int) -> FormationFlight:
    """Flies until the V, lands `lost` UAVs, and flies until the V of the others."""
    scenario = load_scenario("v_formation").with_(
        {"nodes[0].parameters.seed": seed}, uavs=uavs, seed=seed, duration_s=1e4
    )
    rng = np.random.default_rng(seed)
    with Simulation(scenario) as simulation:
        watch = _Watch(simulation)
        simulation.run_until(lambda: watch.phase != "ascend", _TAKE_OFF_S)
        start, wall = simulation.time_s, time.perf_counter()
        time_to_v = watch.wait_for_v(_FORM_S) - start
        factor = (simulation.time_s - start) / (time.perf_counter() - wall)
        begun = simulation.time_s
        for name in rng.choice(sorted(simulation.uavs), lost, replace=False):
            simulation.uavs[name].land()
        again = watch.wait_for_v(_RECOVER_S, uavs - lost) if time_to_v > 0.0 else math.nan
        return FormationFlight(time_to_v, again - begun, watch.min_distance_m, factor)


class _Watch:
    """Follows the node's status and the distances between UAVs in the air."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._status: dict[str, Any] = {"phase": "ascend", "members": [], "cost": math.inf}
        self.min_distance_m = math.inf
        simulation.graph.subscribe(_TOPIC, self._on_status)

    @property
    def phase(self) -> str:
        """What the team does."""
        return str(self._status["phase"])

    def _on_status(self, published: Published) -> None:
        self._status = json.loads(published.message.data)
        vehicles = self._simulation.vehicles.state()
        in_air = vehicles.position_map[~vehicles.crashed]
        apart = np.linalg.norm(in_air[:, None] - in_air, axis=2)
        apart[np.diag_indices(len(apart))] = math.inf
        self.min_distance_m = min(self.min_distance_m, float(apart.min(initial=math.inf)))

    def wait_for_v(self, timeout_s: float, members: int | None = None) -> float:
        """Returns the time of the next V, s; NaN if there is none until the timeout."""

        def is_v() -> bool:
            status = self._status
            size = len(status["members"])
            return self.phase == "cruise" and status["cost"] < _LOST and members in (None, size)

        try:
            self._simulation.run_until(is_v, timeout_s)
        except WaitTimeoutError:
            return math.nan
        return self._simulation.time_s
