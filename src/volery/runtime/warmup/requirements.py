"""Collects the tasks that a scenario, and everything that ships, requires."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from volery.core.errors import DataFileError, ScenarioError
from volery.graph.nodes.node import Node
from volery.runtime.construction.node_loading import find_node
from volery.runtime.warmup import core_tasks
from volery.runtime.warmup.tasks import Task
from volery.scenario.node_names import registered_nodes
from volery.scenario.schema import LidarSensor, NodeEntry, Scenario, UavType
from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.lidar.scan_patterns import PlanarScan

_BY_SENSOR: dict[str, Task] = {
    "camera": core_tasks.images,
    "estimate": core_tasks.estimates,
    "gnss": core_tasks.fixes,
    "magnetometer": core_tasks.magnetic_fields,
}
"""Tasks of sensor kinds that not every UAV has."""


def needs_of(scenario: Scenario, *, nodes: bool = True) -> list[Task]:
    """Returns the tasks of a scenario, with or without its `nodes`; dynamics come first."""
    found: list[Task] = list(core_tasks.ALWAYS)
    kinds = scenario.types.values()
    for kind in kinds:
        found += _of_type(kind, scenario)
    if nodes:
        for entry in scenario.node_entries:
            found += _of_node(entry, scenario)
    return list(dict.fromkeys(found))


def all_needs() -> list[Task]:
    """Returns the tasks that compile everything that ships."""
    from volery.autonomy.mapping.warmup import drawn_scans

    found: list[Task] = [*core_tasks.ALWAYS, *core_tasks.SOMETIMES, drawn_scans]
    for node in shipped_nodes():
        found += node.warmup_tasks()
    return list(dict.fromkeys(found))


def shipped_nodes() -> Iterator[type[Node]]:
    """Yields the classes of Volery's own nodes."""
    for path in registered_nodes().values():
        module, _, name = path.partition(":")
        if module.startswith("volery."):
            yield getattr(import_module(module), name)


def _of_type(kind: UavType, scenario: Scenario) -> Iterator[Task]:
    weather = scenario.world.weather
    is_clear = weather == type(weather)()
    for sensor in kind.sensors:
        if sensor.kind in _BY_SENSOR:
            yield _BY_SENSOR[sensor.kind]
        if isinstance(sensor, LidarSensor):
            if _has_rings(sensor, scenario):
                yield core_tasks.point_clouds
            if not is_clear:
                yield core_tasks.falling_drops
        if sensor.kind == "camera" and not is_clear:
            yield core_tasks.images_in_rain
    if kind.plant != "rigid_body":
        yield core_tasks.other_plants


def _has_rings(sensor: LidarSensor, scenario: Scenario) -> bool:
    try:
        model = load_lidar(scenario.access.find_model(sensor.model))
    except DataFileError:
        return False  # building the sensor raises the error
    return not isinstance(model.scan, PlanarScan)


def _of_node(entry: NodeEntry, scenario: Scenario) -> Iterator[Task]:
    try:
        node = find_node(entry, scenario.name, scenario.access)
    except ScenarioError:
        return  # starting the node raises the error
    try:
        yield from node.warmup_tasks()
    except Exception as error:
        where = f"{scenario.name}: node '{entry.node}'"
        raise ScenarioError(f"{where}: warmup_tasks: {type(error).__name__}: {error}") from error
