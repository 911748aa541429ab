"""`setpoint_raw` and its services, `flight_state`, `get_vehicle_info`."""

import math

import pytest

from volery.core.errors import CommandError
from volery.graph.codecs.zero import zero_message
from volery.runtime import Simulation
from volery.runtime.vehicles.raw_setpoints import steer_to_message, turn_to_message
from volery.scenario.load import parse_scenario

FLAT = {
    "name": "flat",
    "types": {"f450": {"sensors": [{"kind": "odometry", "noise": False}]}},
    "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
}
TARGET, ATTITUDE = "mavros_msgs/msg/PositionTarget", "mavros_msgs/msg/AttitudeTarget"


@pytest.fixture(scope="module")
def simulation():
    with Simulation(parse_scenario(FLAT, where="flat"), threads=1) as simulation:
        simulation.uavs["uav1"].take_off(3.0)
        simulation.run(6.0)
        yield simulation


def target(mask, frame=1, **fields):
    message = zero_message(TARGET)
    message.coordinate_frame, message.type_mask = frame, mask
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def test_invalid_commands_are_reported_once_per_topic(simulation, caplog):
    graph = simulation.graph
    twist = zero_message("geometry_msgs/msg/Twist")
    twist.linear.x = math.nan
    pose = zero_message("geometry_msgs/msg/PoseStamped")
    pose.header.frame_id = "moon"
    for name, message in (("cmd_vel", twist), ("goal_pose", pose)):
        publisher = graph.advertise(f"/uav1/{name}", type(message))
        for _ in range(3):
            publisher.publish(message)
            graph.deliver()
        publisher.cancel()
    warnings = [text for text in caplog.messages if "is not obeyed" in text]
    assert len(warnings) == 2
    assert warnings[0].startswith("/uav1/cmd_vel: ")
    assert (
        warnings[1] == "/uav1/goal_pose: a command is not obeyed: goals are in 'map', not in 'moon'"
    )


def test_masks_say_what_counts(simulation):
    uav = simulation.uavs["uav1"]
    message = target(7 | 7 << 6 | 2048, yaw=math.pi / 2)
    message.velocity.x = 1.0
    for _ in range(15):
        steer_to_message(uav, message)
        simulation.run(0.2)
    assert uav.velocity_map == pytest.approx([1.0, 0.0, 0.0], abs=0.1)
    message.coordinate_frame = 8
    for _ in range(10):
        steer_to_message(uav, message)
        simulation.run(0.2)
    assert uav.velocity_map == pytest.approx([0.0, 1.0, 0.0], abs=0.1)  # it looks north now
    setpoint = target(7 << 3 | 7 << 6 | 1024 | 2048)
    setpoint.position.z = 3.0
    steer_to_message(uav, setpoint)
    simulation.run(6.0)
    assert uav.position_map == pytest.approx([0.0, 0.0, 3.0], abs=0.3)


@pytest.mark.parametrize(
    ("mask", "frame"),
    [(1 | 7 << 3 | 7 << 6, 1), (7 | 7 << 3 | 7 << 6, 1), (7 << 3 | 7 << 6, 8), (7, 3), (512, 1)],
)
def test_what_says_nothing_is_refused(simulation, mask, frame):
    with pytest.raises(CommandError):
        steer_to_message(simulation.uavs["uav1"], target(mask, frame))


def test_thrust_is_a_fraction_and_attitudes_are_checked(simulation):
    uav = simulation.uavs["uav1"]
    message = zero_message(ATTITUDE)
    message.type_mask, message.thrust, message.orientation.w = 7, 1.5, 1.0
    with pytest.raises(CommandError, match="from 0 to 1"):
        turn_to_message(uav, message)
    message.thrust, message.type_mask = 0.5, 7 | 64
    with pytest.raises(CommandError, match="needs a thrust"):
        turn_to_message(uav, message)


def test_state_comes_where_a_node_subscribes_and_is_the_truth(simulation):
    received = []
    publisher_type = "volery_interfaces/msg/FlightState"
    subscription = simulation.graph.subscribe("/uav1/flight_state", received.append, publisher_type)
    simulation.run(0.5)
    subscription.cancel()
    assert len(received) == pytest.approx(50, abs=1)
    state, uav = received[-1].message, simulation.uavs["uav1"]
    assert state.mode == uav.mode.name
    assert state.airborne
    position = state.pose.position
    assert (position.x, position.y, position.z) == pytest.approx(tuple(uav.position_map), abs=0.05)
    count = len(received)
    simulation.run(0.1)
    assert len(received) == count
    build = simulation.graph.call("/uav1/get_vehicle_info")
    assert (build.airframe, build.rotors) == ("f450", 4)
    assert build.latitude == pytest.approx(47.397742)
