"""`/map` is the frame `map` wherever a client names it, as tf2 ignores ROS 1's leading slash."""

import numpy as np
import pytest
from service_calls import call_service, code_of

from volery.graph.codecs.zero import zero_message
from volery.runtime import Simulation
from volery.runtime.services.grid_maps import grid_of
from volery.runtime.vehicles.command_interface import go_to_message
from volery.runtime.vehicles.trajectory_messages import follow_message
from volery.scenario.load import parse_scenario

OK = 1
WALKER = {
    "name": "walker",
    "shape": "person",
    "motion": {"kind": "external", "position_m": [30.0, 0.0, 0.0]},
}
SCENARIO = {
    "name": "flat",
    "world": {"actors": [WALKER]},
    "types": {
        "f450": {"sensors": [{"kind": "odometry", "noise": False}]},
        "puppet": {"airframe": "f450", "plant": "kinematic"},
    },
    "uavs": [
        {"type": "f450", "position_m": [0.0, 0.0, 3.0]},
        {"type": "puppet", "position_m": [10.0, 0.0, 3.0]},
    ],
}
HEADER = {"frame_id": "/map"}


@pytest.fixture
def simulation():
    with Simulation(parse_scenario(SCENARIO, where="flat"), threads=1) as simulation:
        simulation.run(0.1)
        yield simulation


def pose(x, z=3.0):
    message = zero_message("geometry_msgs/msg/PoseStamped")
    message.header.frame_id, message.pose.orientation.w = "/map", 1.0
    message.pose.position.x, message.pose.position.z = x, z
    return message


def send(simulation, topic, message):
    """Publishes as a client; returns the errors that it receives."""
    errors = []
    session = simulation.gateway.open("client")
    session.on_refused = errors.append
    session.advertise(topic, message.__msgtype__)
    session.publish(topic, message)
    simulation.run(0.1)
    session.close()
    return errors


def test_goals_and_trajectories(simulation):
    uav = simulation.uavs["uav1"]
    go_to_message(uav, pose(2.0))
    trajectory = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectory")
    point = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectoryPoint")
    transform = zero_message("geometry_msgs/msg/Transform")
    transform.rotation.w, transform.translation.z = 1.0, 3.0
    point.transforms = [transform]
    trajectory.points, trajectory.header.frame_id = [point], "/map"
    follow_message(uav, trajectory)


def test_poses_of_a_kinematic_uav_and_of_an_actor(simulation):
    assert send(simulation, "/uav2/pose_command", pose(12.0)) == []
    assert simulation.uavs["uav2"].position_map[0] == pytest.approx(12.0)
    assert send(simulation, "/actors/walker/pose", pose(31.0, 0.0)) == []
    state = call_service(simulation, "/get_entity_state", entity="walker").state
    assert state.pose.position.x == pytest.approx(31.0)


def test_states_and_spawning(simulation):
    state = {
        "header": HEADER,
        "pose": {"position": {"x": 5.0, "z": 3.0}, "orientation": {"w": 1.0}},
    }
    response = call_service(
        simulation, "/set_entity_state", entity="uav1", state=state, set_pose=True
    )
    assert code_of(response) == OK, response.result.error_message
    initial_pose = {"header": HEADER, "pose": {"position": {"x": 50.0}}}
    response = call_service(
        simulation,
        "/spawn_entity",
        name="more",
        entity_resource={"uri": "f450"},
        initial_pose=initial_pose,
    )
    assert code_of(response) == OK, response.result.error_message


def test_maps():
    message = zero_message("nav_msgs/msg/OccupancyGrid")
    message.header.frame_id = "/map"
    message.info.width = message.info.height = 2
    message.info.resolution, message.info.origin.orientation.w = 1.0, 1.0
    message.data = np.array([0, 100, 0, 0], np.int8)
    assert grid_of(message, 2.0).blocked.sum() == 1
