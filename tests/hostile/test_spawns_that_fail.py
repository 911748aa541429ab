"""Each step of building and removing a UAV at run time can fail, and the flight goes on."""

from __future__ import annotations

import pytest
from whole_world import Client

from volery.comms.radio.network import RadioNetwork
from volery.control.fleet import Fleet
from volery.engine.collisions import Collisions
from volery.engine.engine import Engine
from volery.engine.faults import FaultPlan
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.graph.nodes.node import Node
from volery.publishing.camera_publishing import CameraPublisher
from volery.publishing.graph_publisher import GraphPublisher
from volery.publishing.lidar_publishing import LidarPublisher
from volery.runtime import snapshot_manager
from volery.runtime.construction import assembly
from volery.runtime.snapshot_manager import SnapshotManager
from volery.runtime.vehicles import manager
from volery.runtime.vehicles.external_odometry import ExternalOdometry
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.flight_states import FlightStates
from volery.runtime.vehicles.latest_samples import LatestSamples
from volery.world.scene import Scene

SPAWN = "simulation_interfaces/srv/SpawnEntity_Request"
DELETE = "simulation_interfaces/srv/DeleteEntity_Request"
OK = 1
FAILED = 150

BUILD = [
    (manager, "assemble"),
    (assembly, "build_fleet"),
    (assembly, "fit_sensors"),
    (assembly, "build_estimation"),
    (assembly, "build_banks"),
    (assembly, "add_bodies"),
    (Scene, "set_bodies"),
    (Engine, "regroup"),
    (Fleet, "continue_from"),
    (Collisions, "continue_from"),
    (Engine, "_new_agenda"),
    (manager, "announce_sensors"),
    (GraphPublisher, "arrange"),
    (GraphPublisher, "announce"),
    (LidarPublisher, "announce"),
    (CameraPublisher, "announce"),
    (CameraPublisher, "set_size"),
    (LatestSamples, "arrange"),
    (manager, "UavSensors"),
    (manager, "Uav"),
    (manager, "open_commands"),
    (manager, "offer_uav_services"),
    (FlightStates, "open"),
    (ExternalOdometry, "open"),
    (RadioNetwork, "join"),
    (FaultPlan, "enlist"),
    (Engine, "restart_sensors"),
    (manager, "start_nodes"),
    (SnapshotManager, "enlist"),
    (snapshot_manager, "save_nodes"),
]
REMOVE = [
    *BUILD[:11],
    (GraphPublisher, "arrange"),
    (LatestSamples, "arrange"),
    (FaultPlan, "enlist"),
    (Engine, "restart_sensors"),
]
"""Steps of a removal that refuse it; the UAV then flies on."""
CLOSE = [
    (GraphPublisher, "retire"),
    (LidarPublisher, "retire"),
    (CameraPublisher, "retire"),
    (LatestSamples, "forget"),
    (FlightFutures, "fail"),
    (Node, "destroy_node"),
    (Graph, "destroy_service"),
    (RadioNetwork, "_leave"),
]
"""Steps after which the UAV is gone, whether they fail or not."""


def name_of(step):
    return f"{getattr(step[0], '__name__', '').rsplit('.', 1)[-1]}.{step[1]}"


class Listener(Node):
    """A node with a topic and a service."""

    broken = False

    def __init__(self, **options):
        super().__init__("listener", **options)
        self.create_publisher(message_type("std_msgs/msg/String"), "heard")
        self.create_service("std_srvs/srv/Trigger", "~/listen", lambda _request: None)
        if self.broken:
            raise RuntimeError("not today")


SENSORS = [
    {"kind": "lidar"},
    {"kind": "lidar", "name": "nodding", "nodding": {}},
    {"kind": "camera", "width": 32, "height": 24},
    {"kind": "imu"},
    {"kind": "odometry"},
    {"kind": "ground_truth"},
]


@pytest.fixture
def client(simulate, flat_data):
    """A client of a simulation of a UAV in flight, with sensors, radio and a node."""
    flat_data["radio"] = {"topics": [{"name": "hello", "type": "std_msgs/msg/String"}]}
    kind = next(iter(flat_data["types"].values()))
    kind["sensors"] = SENSORS
    kind["nodes"] = [{"node": f"{__name__}:Listener"}]
    client = Client(simulate(flat_data))
    client.simulation.run(0.1)
    return client


def spawn(client, name="uav9"):
    message = zero_message(SPAWN)
    message.name = name
    message.entity_resource.uri = next(iter(client.simulation.scenario.types))
    message.initial_pose.pose.position.x = 10.0 * int(name[-1])
    message.initial_pose.pose.position.z = 5.0
    return client.call("/spawn_entity", message).result


def delete(client, name="uav9"):
    return client.call("/delete_entity", message_type(DELETE)(name)).result


def there(client):
    """What the graph has of UAVs."""
    simulation = client.simulation
    graph = simulation.graph
    topics = [t for t in graph.topics() if t.publishers or t.subscribers]
    used = [(topic.name, topic.publishers, topic.subscribers) for topic in topics]
    nodes = [node.full_name for node in simulation.vehicles.nodes]
    return used, graph.services(), nodes, simulation.vehicles.names


def test_a_step_of_building_fails(client, monkeypatch):
    simulation = client.simulation
    before = there(client)
    for step in BUILD:
        state = simulation.uavs["uav1"].position_map
        with monkeypatch.context() as patch:
            patch.setattr(*step, _fail)
            refused = spawn(client)
        assert refused.result == FAILED, name_of(step)
        assert "no room" in refused.error_message, name_of(step)
        assert there(client) == before, name_of(step)
        assert (simulation.uavs["uav1"].position_map == state).all()
        simulation.run(0.05)
        assert spawn(client).result == OK, name_of(step)
        assert simulation.vehicles.names == ("uav1", "uav9")
        simulation.run(0.05)
        assert delete(client).result == OK
        assert there(client) == before, name_of(step)
    simulation.run(0.1)


def test_a_step_of_removing_fails(client, monkeypatch):
    simulation = client.simulation
    assert spawn(client).result == OK
    simulation.run(0.1)
    before = there(client)
    for step in REMOVE:
        with monkeypatch.context() as patch:
            patch.setattr(*step, _fail)
            refused = delete(client)
        assert refused.result not in (0, OK), name_of(step)
        assert "no room" in refused.error_message, name_of(step)
        assert there(client) == before, name_of(step)
        simulation.run(0.05)
        simulation.uavs["uav9"].hold()
    assert delete(client).result == OK
    simulation.run(0.1)
    assert simulation.vehicles.names == ("uav1",)


def test_what_does_not_end_ends_before_the_name_is_used_again(client, monkeypatch):
    simulation = client.simulation
    before = there(client)
    for step in CLOSE:
        assert spawn(client).result == OK, name_of(step)
        simulation.run(0.05)
        with monkeypatch.context() as patch:
            patch.setattr(*step, _fail)
            assert delete(client).result == OK, name_of(step)
        assert simulation.vehicles.names == ("uav1",)
        simulation.run(0.05)
        assert spawn(client).result == OK, name_of(step)
        simulation.run(0.05)
        assert delete(client).result == OK, name_of(step)
        assert there(client) == before, name_of(step)


def test_a_reset_that_fails_leaves_the_flight(client, monkeypatch):
    """Of a fleet in which another UAV has the name of one of the start."""
    simulation = client.simulation
    assert spawn(client, "uav2").result == OK
    simulation.run(0.05)
    assert delete(client, "uav1").result == OK
    assert spawn(client, "uav1").result == OK
    names, before = simulation.vehicles.names, there(client)
    for step in (*BUILD[:11], (manager, "open_commands"), (FaultPlan, "enlist")):
        with monkeypatch.context() as patch:
            patch.setattr(*step, _fail_once(getattr(*step)))
            with pytest.raises(RuntimeError, match="no room"):
                simulation.reset()
        assert simulation.vehicles.names == names, name_of(step)
        assert there(client)[1:3] == before[1:3], name_of(step)
        simulation.run(0.05)
    simulation.reset()
    assert simulation.vehicles.names == ("uav1",)
    simulation.run(0.05)


def test_a_node_that_does_not_start_leaves_nothing(client, monkeypatch):
    """Neither by an error of its constructor nor by a parameter that it does not have."""
    before = there(client)
    monkeypatch.setattr(Listener, "broken", True)
    assert "not today" in spawn(client).error_message
    assert there(client) == before
    monkeypatch.setattr(Listener, "broken", False)
    assert spawn(client).result == OK
    client.simulation.run(0.05)


def test_names_that_a_client_has_taken(client):
    """A spawn that a client's service or topic is in the way of says so, and works later."""
    simulation = client.simulation
    before = there(client)
    other = Client(simulation, "rosbridge 127.0.0.1:1")
    for name in ("land", "get_vehicle_info", "listener/listen", "take_off"):
        service = f"/uav9/{name}"
        other.session.create_service(service, "std_srvs/srv/Trigger", lambda *_args: None)
        refused = spawn(client)
        assert refused.result not in (0, OK)
        assert service in refused.error_message
        assert other.session.name in refused.error_message
        simulation.run(0.05)
        other.session.destroy_service(service)
        assert there(client) == before
    for name in ("odom", "imu", "cmd_vel", "camera/depth", "flight_state", "heard", "hello"):
        topic = f"/uav9/{name}"
        other.session.advertise(topic, "std_msgs/msg/Empty")
        refused = spawn(client)
        assert refused.result not in (0, OK)
        assert topic in refused.error_message
        simulation.run(0.05)
        other.session.unadvertise(topic)
        assert there(client) == before
    assert spawn(client).result == OK
    simulation.run(0.1)


def _fail(*_args, **_kwargs):
    raise RuntimeError("no room")


def _fail_once(real):
    """Fails at the first call; what undoes the change calls again."""
    failures = iter([RuntimeError("no room")])

    def call(*args, **kwargs):
        if (error := next(failures, None)) is not None:
            raise error
        return real(*args, **kwargs)

    return call
