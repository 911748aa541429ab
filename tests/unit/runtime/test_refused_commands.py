"""Messages of clients that are not obeyed: the client and `/volery/log` learn why."""

import json
import math

import numpy as np
import pytest
from ros_tcp_client import frame
from rosbridge_bench import TIME_NS

from volery.bridges.ros_tcp.session import EndpointSession
from volery.bridges.ros_tcp.wire import RosTcpFrameParser
from volery.bridges.rosbridge.protocol import RosbridgePeer, ServerContext
from volery.core import rotations
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.command_records import TOPIC, TYPE
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

FLAT = {
    "name": "flat",
    "types": {"f450": {"sensors": [{"kind": "odometry", "noise": False}]}},
    "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
}
POSE = "geometry_msgs/msg/PoseStamped"


@pytest.fixture
def simulation():
    with Simulation(parse_scenario(FLAT, where="flat"), threads=1) as simulation:
        yield simulation


@pytest.fixture(scope="module")
def flying():
    with Simulation(parse_scenario(FLAT, where="flat"), threads=1) as simulation:
        simulation.uavs["uav1"].take_off(3.0)
        simulation.run(6.0)
        yield simulation


def goal(frame="map", x=2.0):
    message = zero_message(POSE)
    message.header.frame_id, message.pose.orientation.w = frame, 1.0
    message.pose.position.x, message.pose.position.z = x, 3.0
    return message


def refusals_of(simulation, topic, *messages):
    """Returns the errors that a client receives, and what the log records, about its messages."""
    errors, logged = [], []
    log = simulation.graph.subscribe(TOPIC, lambda p: logged.append(p.message), TYPE)
    session = simulation.gateway.open("client")
    session.on_refused = errors.append
    session.advertise(topic, messages[0].__msgtype__)
    for message in messages:
        session.publish(topic, message)
    simulation.run(0.1)
    session.close()
    log.cancel()
    return errors, [(r.client, r.name, r.content) for r in logged if r.kind == "refused"]


@pytest.mark.parametrize(
    ("message", "words"),
    [(goal("moon"), "goals are in 'map', not in 'moon'"), (goal(x=math.nan), "finite")],
)
def test_a_goal_that_cannot_be(flying, message, words):
    errors, logged = refusals_of(flying, "/uav1/goal_pose", message)
    assert len(errors) == 1
    assert errors[0].startswith("/uav1/goal_pose: ")
    assert words in errors[0]
    assert logged == [("client", "/uav1/goal_pose", errors[0].partition(": ")[2])]


def test_a_goal_in_the_map_with_a_slash(flying):
    assert refusals_of(flying, "/uav1/goal_pose", goal("/map")) == ([], [])
    flying.run(10.0)
    assert flying.uavs["uav1"].position_map[0] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("z", "w", "degrees"), [(1.0, 1.0, 90.0), (0.1, 0.1, 90.0), (-0.7, 0.7, -90.0), (0.0, 3.0, 0.0)]
)
def test_a_goal_has_the_heading_of_its_quaternion_whatever_its_length(flying, z, w, degrees):
    message = goal()
    message.pose.orientation.z, message.pose.orientation.w = z, w
    assert refusals_of(flying, "/uav1/goal_pose", message) == ([], [])
    flying.run_until(lambda: abs(heading_deg(flying) - degrees) < 2.0, timeout_s=30.0)
    flying.run(1.0)
    assert heading_deg(flying) == pytest.approx(degrees, abs=2.0)


def heading_deg(flying):
    return float(np.degrees(rotations.yaw_of(flying.uavs["uav1"].attitude)))


def test_a_trajectory_has_the_heading_of_its_quaternion(flying):
    message = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectory")
    point = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectoryPoint")
    transform = zero_message("geometry_msgs/msg/Transform")
    transform.translation.x, transform.translation.z = 2.0, 3.0
    transform.rotation.z = transform.rotation.w = 0.65  # 0.92 long
    point.transforms, point.time_from_start.sec = [transform], 4
    message.points = [point]
    assert refusals_of(flying, "/uav1/trajectory", message) == ([], [])
    flying.run(8.0)
    assert heading_deg(flying) == pytest.approx(90.0, abs=2.0)


def test_a_trajectory_without_rotation(flying):
    message = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectory")
    point = zero_message("trajectory_msgs/msg/MultiDOFJointTrajectoryPoint")
    transform = zero_message("geometry_msgs/msg/Transform")
    transform.rotation.w = 0.0
    point.transforms = [transform]
    message.points = [point]
    errors, _ = refusals_of(flying, "/uav1/trajectory", message)
    assert "unit quaternions" in errors[0]


def test_a_pose_of_a_uav_that_flies_by_itself(flying):
    errors, logged = refusals_of(flying, "/uav1/pose_command", goal())
    assert len(errors) == len(logged) == 1


def test_a_goal_on_the_ground_and_during_take_off(simulation):
    errors, _ = refusals_of(simulation, "/uav1/goal_pose", goal())
    assert "must take off first" in errors[0]
    simulation.uavs["uav1"].take_off(3.0)
    simulation.run(0.5)
    errors, _ = refusals_of(simulation, "/uav1/goal_pose", goal())
    assert "TAKE_OFF" in errors[0]


def test_a_stream_on_the_ground_is_no_news(simulation):
    twist = zero_message("geometry_msgs/msg/Twist")
    assert refusals_of(simulation, "/uav1/cmd_vel", twist, twist) == ([], [])


def test_a_stream_of_refusals_is_reported_once(flying, monkeypatch):
    monkeypatch.setattr("volery.graph.session._REFUSAL_PERIOD_S", 1e9)
    errors, logged = refusals_of(flying, "/uav1/goal_pose", *[goal("moon")] * 30)
    assert len(errors) == 1
    assert len(logged) == 30
    frames = [goal(f"moon{k}") for k in range(30)]
    assert len(refusals_of(flying, "/uav1/goal_pose", *frames)[0]) == 20


def test_weather_that_cannot_be(flying):
    message = zero_message("volery_interfaces/msg/Weather")
    message.rain = math.nan
    errors, _ = refusals_of(flying, "/weather_command", message)
    assert len(errors) == 1


def test_a_client_of_ros_tcp_receives_an_error(flying):
    session = EndpointSession(flying.gateway, "ros-tcp", "ros2", 10, lambda: None)
    parser = RosTcpFrameParser()
    announced = {"topic": "/uav1/goal_pose", "message_name": POSE}
    sent = frame("__publish", json.dumps(announced).encode())
    sent += frame("/uav1/goal_pose", bytes(encode_cdr(goal("moon"), POSE)))
    for one in parser.feed(sent):
        session.take(one)
    flying.run(0.1)
    received, reader = [], RosTcpFrameParser()
    while parts := session.outbox.gather():
        for part in parts:
            received += reader.feed(part)
    session.close()
    (error,) = [one for one in received if one.destination == "__error"]
    assert "'moon'" in json.loads(bytes(error.payload))["text"]


def test_a_client_of_rosbridge_receives_a_status(flying):
    session = flying.gateway.open("rosbridge 127.0.0.1:1")
    peer = RosbridgePeer(
        session,
        ServerContext(now_ns=lambda: TIME_NS),
        wake=lambda: None,
        post=lambda action: action(),
    )
    message = {"header": {"frame_id": "moon"}, "pose": {"position": {"z": 3}}}
    peer.receive(json.dumps({"op": "publish", "topic": "/uav1/goal_pose", "msg": message}), 0.0)
    flying.run(0.1)
    (status,) = map(json.loads, peer.frames(0.0))
    assert status["op"] == "status"
    assert status["level"] == "error"
    assert "'moon'" in status["msg"]
    peer.close()
