"""Services and topics of one UAV: flight modes with arguments, goals, velocity commands."""

import numpy as np
import pytest
from service_calls import call_service

from volery.core.errors import CommandError
from volery.graph.messages import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Twist,
    Vector3,
    header,
)


@pytest.fixture
def pair(simulate, flat_data):
    """uav1 stands, uav2 hovers at 5 m."""
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0]},
        {"type": "f450", "position_m": [20.0, 0.0, 5.0]},
    ]
    return simulate(flat_data)


def twist(x, z=0.0):
    return Twist(Vector3(x, 0.0, 0.0), Vector3(0.0, 0.0, z))


def fly(simulation, velocity, uav="uav2"):
    simulation.graph.advertise(f"/{uav}/cmd_vel", Twist).publish(twist(velocity))
    simulation.graph.deliver()


def test_arming_says_what_it_is(pair):
    standing = call_service(pair, "/uav1/arm")
    assert standing.success
    assert "take_off" in standing.message
    flying = call_service(pair, "/uav2/arm")
    assert flying.success
    assert "flies" in flying.message
    pair._engine.fleet.crash(1)
    wrecked = call_service(pair, "/uav2/arm")
    assert not wrecked.success
    assert "crashed" in wrecked.message


def test_disarming_lets_nothing_fall(pair):
    assert call_service(pair, "/uav1/disarm").success
    response = call_service(pair, "/uav2/disarm")
    assert not response.success
    assert "kill" in response.message


def test_take_off_to_a_height(pair):
    assert call_service(pair, "/uav1/take_off_to", altitude=4.0).success
    pair.run(6.0)
    assert pair.uavs["uav1"].position_map[2] == pytest.approx(4.1, abs=0.3)
    again = call_service(pair, "/uav1/take_off_to", altitude=4.0)
    assert not again.success
    assert "is flying" in again.message


@pytest.mark.parametrize("altitude", [0.0, -1.0, float("nan"), 1e9])
def test_heights_that_are_none(pair, altitude):
    response = call_service(pair, "/uav1/take_off_to", altitude=altitude)
    assert not response.success
    assert response.message
    assert pair.uavs["uav1"].mode.name == "LANDED"


def test_plain_services_stay_triggers(pair):
    for name in ("take_off", "hold", "land", "return_home"):
        assert pair.graph.services()[f"/uav1/{name}"] == "std_srvs/srv/Trigger"
    assert not call_service(pair, "/uav1/land").success
    assert call_service(pair, "/uav1/take_off").success
    assert call_service(pair, "/uav2/return_home").success


def test_go_to(pair):
    goal = {"x": 22.0, "y": 1.0, "z": 6.0}
    assert call_service(pair, "/uav2/go_to", position=goal, yaw=1.0).success
    pair.run(6.0)
    uav = pair.uavs["uav2"]
    assert np.linalg.norm(uav.position_map - [22.0, 1.0, 6.0]) < 0.3
    heading = 2.0 * np.arctan2(uav.attitude[2], uav.attitude[3])
    assert heading == pytest.approx(1.0, abs=0.1)
    assert call_service(pair, "/uav2/go_to", position=goal, yaw=9.0, keep_heading=True).success
    standing = call_service(pair, "/uav1/go_to", position=goal)
    assert not standing.success
    assert "take off" in standing.message
    bad = call_service(pair, "/uav2/go_to", position={"x": float("nan")})
    assert not bad.success
    call_service(pair, "/uav1/take_off")
    assert "takes off" in call_service(pair, "/uav1/go_to", position=goal).message


def goal(position, rotation=(0.0, 0.0, 0.0, 0.0), frame="map"):
    return PoseStamped(header(0, frame), Pose(Point(*position), Quaternion(*rotation)))


def test_goals_are_flown_to(pair):
    publisher = pair.graph.advertise("/uav2/goal_pose", PoseStamped)
    publisher.publish(goal((21.0, 0.0, 5.5)))
    pair.run(5.0)
    there = pair.uavs["uav2"].position_map
    assert np.linalg.norm(there - [21.0, 0.0, 5.5]) < 0.3


@pytest.mark.parametrize(
    "message",
    [
        goal((float("inf"), 0.0, 5.0)),
        goal((1.0, 0.0, 5.0), frame="odom"),
        goal((1.0, 0.0, 5.0), (float("nan"),) * 4),
    ],
)
def test_goals_that_are_none_are_passed_over(pair, message):
    pair.graph.advertise("/uav2/goal_pose", PoseStamped).publish(message)
    pair.graph.deliver()
    assert pair.uavs["uav2"].mode.name == "HOLD"


def test_velocity_commands_come_out_as_applied(pair):
    applied = []
    pair.graph.subscribe("/uav2/cmd_vel/applied", applied.append)
    pair.run(0.0125)
    pair.step()
    fly(pair, 1.5)
    (published,) = applied
    assert published.message.header.frame_id == "uav2/base_link"
    assert published.message.header.stamp.nanosec == pair.time_ns == 13_000_000
    assert published.message.twist.linear.x == 1.5


def test_refused_velocity_commands_do_not(pair):
    applied = []
    for name in ("uav1", "uav2"):
        pair.graph.subscribe(f"/{name}/cmd_vel/applied", applied.append)
    fly(pair, 1.0, "uav1")  # it stands
    fly(pair, float("nan"))
    call_service(pair, "/uav1/take_off")
    fly(pair, 1.0, "uav1")  # it takes off
    assert applied == []
    assert pair.uavs["uav1"].mode.name == "TAKE_OFF"


def test_a_silent_commander_is_not_followed_for_long(pair):
    def holds_after(seconds):
        fly(pair, 1.0)
        for tick in range(400):
            pair.run(0.01)
            if pair.uavs["uav2"].mode.name == "HOLD":
                assert 0.01 * tick == pytest.approx(seconds, abs=0.03)
                return
        raise AssertionError("it never held")

    holds_after(0.5)
    assert call_service(pair, "/uav2/set_command_timeout", seconds=1.2).success
    holds_after(1.2)


@pytest.mark.parametrize("seconds", [0.0, -1.0, 61.0, float("nan")])
def test_time_outs_that_are_none(pair, seconds):
    response = call_service(pair, "/uav2/set_command_timeout", seconds=seconds)
    assert not response.success
    assert "out of range" in response.message


@pytest.mark.parametrize("method", ["service", "post"])
def test_a_stop_acts_with_the_very_next_physics_step(pair, method):
    """However long the run is that it comes into: what is posted comes before the physics."""
    pair.run(0.1005)
    turning = pair.uavs["uav2"].rotor_speed
    if method == "service":
        assert call_service(pair, "/uav2/kill").success
    else:
        pair.post(lambda: call_service(pair, "/uav2/kill"))
    pair.step()
    once = pair.uavs["uav2"].rotor_speed
    assert (once < turning).all()
    pair.step()
    assert (pair.uavs["uav2"].rotor_speed < once).all()
    assert call_service(pair, "/uav1/kill").success  # its rotors stand still


def test_a_killed_uav_falls_under_a_stream_of_twists_until_it_holds(pair):
    uav = pair.uavs["uav2"]
    session = pair.gateway.open("client")
    session.advertise("/uav2/cmd_vel", "geometry_msgs/msg/Twist")
    height = uav.position_map[2]
    assert call_service(pair, "/uav2/kill").success
    for _ in range(10):
        session.publish("/uav2/cmd_vel", twist(0.0))
        pair.run(0.05)
    assert uav.rotors_stopped
    assert height - uav.position_map[2] > 0.8  # half a second of free fall, less drag
    assert call_service(pair, "/uav2/hold").success
    session.publish("/uav2/cmd_vel", twist(0.0))
    pair.run(0.05)
    assert not uav.rotors_stopped
    assert uav.mode.name == "VELOCITY"
    session.close()


def test_a_posted_twist_is_in_force_before_the_next_step(pair):
    session = pair.gateway.open("client")
    applied = []
    pair.graph.subscribe("/uav2/cmd_vel/applied", applied.append)
    session.advertise("/uav2/cmd_vel", "geometry_msgs/msg/Twist")
    pair.run(0.05)
    before = pair.time_ns
    session.publish("/uav2/cmd_vel", twist(0.0))
    pair.step()
    assert [p.message.header.stamp.nanosec for p in applied] == [before]
    session.close()


def test_a_stopped_kinematic_uav_stands_in_the_air(simulate, flat_data):
    flat_data["types"]["f450"]["plant"] = "kinematic"
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    simulation = simulate(flat_data)
    fly(simulation, 2.0, "uav1")
    simulation.run(0.3)
    assert call_service(simulation, "/uav1/kill").success
    stopped_at = simulation.uavs["uav1"].position_map
    simulation.run(0.2)
    assert np.linalg.norm(simulation.uavs["uav1"].position_map - stopped_at) < 0.01


def test_something_outside_may_move_a_kinematic_uav(simulate, flat_data):
    flat_data["types"]["f450"]["plant"] = "kinematic"
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    simulation = simulate(flat_data)
    poses = simulation.graph.advertise("/uav1/pose_command", PoseStamped)
    turn = Quaternion(0.0, 0.0, np.sin(0.5), np.cos(0.5))
    poses.publish(PoseStamped(header(0, "map"), Pose(Point(1.0, 2.0, 6.0), turn)))
    poses.publish(PoseStamped(header(0, "uav1/odom"), Pose(Point(9.0, 9.0, 9.0), turn)))
    simulation.step(2)
    uav = simulation.uavs["uav1"]
    np.testing.assert_allclose(uav.position_map, [1.0, 2.0, 6.0], atol=1e-9)
    np.testing.assert_allclose(uav.attitude, [0.0, 0.0, np.sin(0.5), np.cos(0.5)], atol=1e-9)


def test_poses_are_for_kinematic_uavs(pair):
    before = pair.uavs["uav2"].position_map
    pose = Pose(Point(1.0, 2.0, 6.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    pair.graph.advertise("/uav2/pose_command", PoseStamped).publish(
        PoseStamped(header(0, "map"), pose)
    )
    pair.step(2)
    assert np.linalg.norm(pair.uavs["uav2"].position_map - before) < 0.1


def test_applied_commands_are_the_same_in_equal_runs(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]

    def digest():
        simulation = simulate(flat_data)
        simulation.diagnostics.enable_digest()
        for _ in range(5):
            fly(simulation, 1.0, "uav1")
            simulation.run(0.1)
        return simulation.diagnostics.digest()

    assert digest() == digest()


@pytest.mark.parametrize("z", [-3.0, 0.0])
def test_a_goal_below_the_ground_is_refused(pair, z):
    response = call_service(pair, "/uav2/go_to", position={"x": 10.0, "y": 3.0, "z": z})
    assert not response.success
    assert "under the ground" in response.message
    assert "z must be at least 0.1" in response.message
    pair.run(2.0)
    assert pair.uavs["uav2"].position_map == pytest.approx([20.0, 0.0, 5.0], abs=0.3)


def test_a_goal_inside_an_obstacle_is_refused(simulate, wood_data):
    wood = simulate(wood_data)
    trunk = wood.world.forest.position_map[0] + [0.0, 0.0, 1.0]
    x, y, z = trunk.tolist()
    response = call_service(wood, "/uav1/go_to", position={"x": x, "y": y, "z": z})
    assert not response.success
    assert "tree" in response.message
    with pytest.raises(CommandError, match=r"the goal .* lies in"):
        wood.uavs["uav1"].go_to(trunk)


def test_a_goal_that_is_a_message_is_checked_too(pair, caplog):
    goal = PoseStamped(header(0, "map"), Pose(Point(5.0, 0.0, -2.0), Quaternion(0, 0, 0, 1.0)))
    pair.graph.advertise("/uav2/goal_pose", PoseStamped).publish(goal)
    pair.graph.deliver()
    assert "under the ground" in caplog.text
