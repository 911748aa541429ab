"""Builds everything of a simulation that depends on the set of UAVs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from volery.control.fleet import Fleet
from volery.engine.engine import SensorBank
from volery.runtime.construction.estimation import build_estimation
from volery.runtime.construction.fleet import add_bodies, build_fleet
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.sensor_suites import SensorInstance, fit_sensors
from volery.runtime.construction.sensors import build_banks
from volery.scenario.schema import Scenario
from volery.world.scene import Scene

if TYPE_CHECKING:
    from volery.engine.estimation import Estimation


@dataclass(frozen=True)
class Assembly:
    """Holds a fleet at its start, with sensors and estimators."""

    fleet: Fleet
    fitted: list[SensorInstance]
    banks: list[SensorBank]
    estimation: Estimation | None


def assemble(
    scenario: Scenario, starts: Sequence[StartPose], scene: Scene, partition: Partition = WHOLE
) -> Assembly:
    """Builds the UAVs of `starts` and replaces the bodies in `scene` by theirs.

    partition: the UAVs whose LIDARs and cameras get a bank.

    Raises `ScenarioError` or `DataFileError` if a part cannot be built; the scene is then
    unchanged.
    """
    fleet = build_fleet(scenario, starts, tuple(start.name for start in starts))
    fitted = fit_sensors(scenario, starts)
    estimation = build_estimation(scenario, fitted, fleet)
    banks = build_banks(scenario, fitted, fleet, scene, estimation, partition)
    add_bodies(scene, starts)
    return Assembly(fleet, fitted, banks, estimation)
