"""Flies the scenario `v_formation` and follows what its node publishes."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from volery.core.errors import WaitTimeoutError
from volery.graph.messages import Published
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

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


class FormationWatch(Protocol):
    """Follows the formation in which a team flies."""

    min_distance_m: float
    """Least distance between two UAVs in the air."""

    @property
    def has_begun(self) -> bool:
        """Whether the take-off is over."""

    def wait_for_v(self, timeout_s: float, lost: Sequence[str] = ()) -> float:
        """Returns the time of the next V of all but the lost UAVs, s; NaN after the timeout."""


def fly(seed: int, uavs: int, lost: int) -> FormationFlight:
    """Flies until the V, lands `lost` UAVs, and flies until the V of the others."""
    scenario = load_scenario("v_formation").with_(
        {"nodes[0].parameters.seed": seed}, uavs=uavs, seed=seed, duration_s=1e4
    )
    return fly_scenario(scenario, _StatusWatch, lost)


def fly_scenario(
    scenario: Scenario, watched: Callable[[Simulation], FormationWatch], lost: int
) -> FormationFlight:
    """Flies a scenario as `fly`; the UAVs to land are drawn by its seed."""
    rng = np.random.default_rng(scenario.seed)
    with Simulation(scenario) as simulation:
        watch = watched(simulation)
        simulation.run_until(lambda: watch.has_begun, _TAKE_OFF_S)
        start, wall = simulation.time_s, time.perf_counter()
        time_to_v = watch.wait_for_v(_FORM_S) - start
        factor = (simulation.time_s - start) / (time.perf_counter() - wall)
        begun = simulation.time_s
        names = [str(name) for name in rng.choice(sorted(simulation.uavs), lost, replace=False)]
        for name in names:
            simulation.uavs[name].land()
        again = watch.wait_for_v(_RECOVER_S, names) if time_to_v > 0.0 else math.nan
        return FormationFlight(time_to_v, again - begun, watch.min_distance_m, factor)


def least_distance_m(simulation: Simulation) -> float:
    """Returns the least distance between two UAVs in the air at present."""
    vehicles = simulation.vehicles.state()
    in_air = vehicles.position_map[~vehicles.crashed]
    apart = np.linalg.norm(in_air[:, None] - in_air, axis=2)
    apart[np.diag_indices(len(apart))] = math.inf
    return float(apart.min(initial=math.inf))


class _StatusWatch:
    """Follows the node's status and the distances between UAVs in the air."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._status: dict[str, Any] = {"phase": "ascend", "members": [], "cost": math.inf}
        self.min_distance_m = math.inf
        simulation.graph.subscribe(_TOPIC, self._on_status)

    @property
    def has_begun(self) -> bool:
        """See `FormationWatch`."""
        return str(self._status["phase"]) != "ascend"

    def _on_status(self, published: Published) -> None:
        self._status = json.loads(published.message.data)
        self.min_distance_m = min(self.min_distance_m, least_distance_m(self._simulation))

    def wait_for_v(self, timeout_s: float, lost: Sequence[str] = ()) -> float:
        """See `FormationWatch`."""
        size = len(self._simulation.uavs) - len(lost) if lost else None

        def is_v() -> bool:
            status = self._status
            is_whole = size in (None, len(status["members"]))
            return status["phase"] == "cruise" and status["cost"] < _LOST and is_whole

        try:
            self._simulation.run_until(is_v, timeout_s)
        except WaitTimeoutError:
            return math.nan
        return self._simulation.time_s
