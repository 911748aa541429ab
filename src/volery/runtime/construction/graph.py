"""Connects a scenario to the graph: sensor topics, nodes, faults and the end of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from volery.control.flight_modes import DOWN_MODES, FlightMode
from volery.core import rotations
from volery.core.clock import ns_from_s
from volery.core.errors import CommandError, ScenarioError
from volery.core.undo_steps import UndoSteps
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.faults import FaultPlan
from volery.graph.graph import Graph
from volery.graph.nodes.node import Context, Node
from volery.publishing.camera_messages import Camera
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.construction.node_loading import start_node
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.sensor_suites import RESULT_OF, SensorInstance
from volery.runtime.vehicles.uav import Uav
from volery.scenario.camera import CameraSensor
from volery.scenario.schema import EstimateSensor, NodeEntry, Scenario
from volery.sensors.samples import JointAngles


def announce_sensors(
    publisher: GraphPublisher, fitted: Sequence[SensorInstance], partition: Partition = WHOLE
) -> None:
    """Advertises the topics of the sensors; `partition` of a divided run samples its own."""
    for sensor in fitted:
        local = partition.serves(sensor.id.uav_name)
        if sensor.lidar is not None:
            publisher.announce_lidar(
                sensor.id, sensor.lidar, sensor.topic, sensor.mount, local=local
            )
        elif isinstance(sensor.spec, CameraSensor):
            camera = Camera(sensor.id, sensor.spec, sensor.left)
            publisher.announce_camera(camera, sensor.mount, local=local)
        else:
            kind, spec = RESULT_OF[sensor.spec.kind], sensor.spec
            by_a_node = isinstance(spec, EstimateSensor) and spec.external_odometry is not None
            publisher.announce(sensor.id, kind, sensor.mount, in_map=not by_a_node)
        if sensor.mount.nods:
            publisher.announce(sensor.id, JointAngles, sensor.mount)


START_POSE = "{start_pose}"
"""Placeholder in a node's parameters for the UAV's start pose: x, y, z, m, and yaw, rad."""
UAV_NAMES = "{uavs}"
"""Placeholder in a node's parameters for the names of all UAVs."""


def start_nodes(
    scenario: Scenario,
    starts: Sequence[StartPose],
    graph: Graph,
    engine: Engine,
    now_ns: Callable[[], int],
) -> list[Node]:
    """Starts the nodes of the UAVs `starts`, in fleet order; if one does not start, none runs."""
    nodes: list[Node] = []
    started = UndoSteps()
    try:
        for start in starts:
            for k, entry in enumerate(scenario.types[start.type_name].nodes):
                where = f"{scenario.name}: types.{start.type_name}.nodes[{k}]"
                context = _context(scenario, entry, graph, engine, now_ns)
                own = _filled(_with_start(entry, start), UAV_NAMES, list(engine.names))
                node = start_node(own, context, f"/{start.name}", where, scenario.access)
                started.add(node.destroy_node)
                nodes.append(node)
    except Exception:
        started.run()
        raise
    return nodes


def _with_start(entry: NodeEntry, start: StartPose) -> NodeEntry:
    """Returns the entry with the start pose in place of `START_POSE`: x, y, z, m; yaw, rad; map."""
    pose = [*start.position_map.tolist(), float(rotations.yaw_of(start.attitude))]
    return _filled(entry, START_POSE, pose)


def _filled(entry: NodeEntry, placeholder: str, value: Any) -> NodeEntry:
    """Returns the entry with a value in place of a placeholder in its parameters."""
    if placeholder not in entry.parameters.values():
        return entry
    known = {k: value if v == placeholder else v for k, v in entry.parameters.items()}
    return entry.model_copy(update={"parameters": known})


def start_system_nodes(
    scenario: Scenario, graph: Graph, engine: Engine, now_ns: Callable[[], int]
) -> list[Node]:
    """Starts the nodes of the whole system, in the order of the scenario."""
    nodes = []
    for k, entry in enumerate(scenario.nodes):
        context = _context(scenario, entry, graph, engine, now_ns)
        where = f"{scenario.name}: nodes[{k}]"
        own = _filled(entry, UAV_NAMES, list(engine.names))
        nodes.append(start_node(own, context, "", where, scenario.access))
    return nodes


def _context(
    scenario: Scenario, entry: NodeEntry, graph: Graph, engine: Engine, now_ns: Callable[[], int]
) -> Context:
    """Returns the context of one node entry of the scenario."""
    return Context(
        graph,
        engine,
        now_ns,
        ns_from_s(entry.latency_s),
        allows_folder=scenario.access.allows_work_folder,
        find_file=partial(scenario.access.find_file, shipped=None),
    )


def plan_faults(plan: FaultPlan, scenario: Scenario) -> None:
    """Plans the scenario's faults. Raises `ScenarioError` with the key of an invalid one."""
    for k, fault in enumerate(scenario.faults):
        try:
            plan.add(fault)
        except CommandError as error:
            raise ScenarioError(f"{scenario.name}: faults[{k}]: {error}") from None


def all_down(uavs: Mapping[str, Uav], events: Sequence[Event]) -> bool:
    """Returns whether every UAV has crashed, or has flown and landed."""
    for uav in uavs.values():
        if uav.mode not in DOWN_MODES:  # most often the first one flies
            return False
    flown = {event.uav for event in events}
    return all(uav.mode is FlightMode.CRASHED or name in flown for name, uav in uavs.items())
