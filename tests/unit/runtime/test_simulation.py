"""Stepping, pacing, ending, and what the graph carries."""

import numpy as np
import pytest
from fake_wall_clock import FakeWallClock

import volery
from volery.core.errors import CommandError, ScenarioError, VoleryError
from volery.engine import pacing
from volery.graph.messages import (
    Imu,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    Vector3,
    header,
    message_type,
)
from volery.graph.typestore import typestore
from volery.runtime.monitoring import progress

Duration = message_type("builtin_interfaces/msg/Duration")


def collect(simulation, seconds):
    got = {}
    simulation.graph.subscribe_all(lambda m: got.setdefault(m.topic, []).append(m))
    simulation.run(seconds)
    return got


def test_topics_rates_and_stamps(simulate, wood_data):
    wood_data["types"]["surveyor"]["nodes"] = []
    got = collect(simulate(wood_data), 1.0)
    counts = {topic: len(messages) for topic, messages in got.items()}
    assert counts["/uav1/laser/horizontal/scan"] == 40
    assert counts["/uav2/laser/nodding/scan"] == 40
    assert counts["/uav1/imu"] == 201
    assert counts["/uav1/range"] == 11
    assert counts["/uav1/odom"] == counts["/uav1/ground_truth/odom"] == 51
    assert counts["/uav1/joint_states"] == 81
    assert counts["/clock"] == 100
    assert counts["/tf_static"] == 1
    scan = got["/uav1/laser/horizontal/scan"][1]
    assert scan.message.header.stamp.nanosec == 25_000_000  # first beam
    assert scan.time_ns == 44_000_000  # the sweep of 18.75 ms has ended
    assert scan.message.header.frame_id == "uav1/laser_horizontal"
    assert not scan.message.ranges.flags.writeable
    for messages in got.values():
        store = typestore()
        again = store.deserialize_cdr(messages[-1].cdr, messages[-1].msgtype)
        assert bytes(store.serialize_cdr(again, messages[-1].msgtype)) == messages[-1].cdr


def test_transforms_form_one_tree(simulate, wood_data):
    wood_data["types"]["surveyor"]["nodes"] = []
    got = collect(simulate(wood_data), 0.2)
    parent = {}
    for message in got["/tf"] + got["/tf_static"]:
        for transform in message.message.transforms:
            parent.setdefault(transform.child_frame_id, set()).add(transform.header.frame_id)
    assert all(len(parents) == 1 for parents in parent.values()), parent

    def root(frame):
        return root(next(iter(parent[frame]))) if frame in parent else frame

    for frame in ("uav1/laser_nodding", "uav2/laser_horizontal", "uav1/imu", "uav1/range"):
        assert root(frame) == "map"


def test_fixed_transforms_reach_late_subscribers(simulate, flat_data):
    flat_data["types"]["f450"]["nodes"] = []
    simulation = simulate(flat_data)
    simulation.run(0.5)
    late = []
    simulation.graph.subscribe("/tf_static", late.append)
    simulation.run(0.5)
    (message,) = late
    assert message.time_ns == 500_000_000
    children = {t.child_frame_id for t in message.message.transforms}
    assert children == {"uav1/imu", "uav1/range", "uav1/odom"}


def test_real_time_and_faster(simulate, flat_data, monkeypatch):
    simulation, clock = simulate(flat_data), FakeWallClock()
    for module in (pacing, progress):
        monkeypatch.setattr(module, "time", clock.time)
    monkeypatch.setattr(simulation._pacer._changed, "wait", clock.wait)
    simulation.run(0.1)
    start_s = clock.now_s
    simulation.run(0.5, speed=1.0)
    assert clock.now_s - start_s == pytest.approx(0.5, abs=0.02)
    reports = []
    simulation.run(0.5, speed=2.0, on_progress=reports.append)
    assert reports[-1].time_s == pytest.approx(0.5)
    assert reports[-1].real_time_factor == pytest.approx(2.0, rel=0.05)


def test_single_steps(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.step()
    assert simulation.time_ns == 1_000_000
    simulation.step(9)
    assert simulation.time_ns == 10_000_000
    simulation.step(0)
    assert simulation.time_ns == 10_000_000


def test_bad_requests(simulate, flat_data):
    simulation = simulate(flat_data)
    for seconds in (-1.0, float("nan"), float("inf")):
        with pytest.raises(CommandError, match="finite"):
            simulation.run(seconds)
    with pytest.raises(CommandError, match="speed"):
        simulation.run(1.0, speed=0.0)
    with pytest.raises(CommandError, match="negative"):
        simulation.step(-1)
    with pytest.raises(ScenarioError, match="threads"):
        simulate(flat_data, threads=0)
    with pytest.raises(CommandError):
        simulation.uavs["uav1"].go_to([np.nan, 0, 0])


@pytest.mark.parametrize("wrong", ["x", None, [1.0, "y", 2.0], object(), {}, np.zeros((2, 2)), 1j])
def test_commands_of_the_wrong_type(simulate, flat_data, wrong):
    uav = simulate(flat_data).uavs["uav1"]
    commands = [
        lambda: uav.go_to(wrong),
        lambda: uav.command_velocity(wrong),
        lambda: uav.command_velocity([1.0, 0.0, 0.0], wrong),
        lambda: uav.command_velocity_map(wrong),
        lambda: uav.command_attitude(wrong, 10.0),
        lambda: uav.command_attitude([0.0, 0.0, 0.0, 1.0], wrong),
        lambda: uav.command_rates(wrong, 10.0),
        lambda: uav.command_rotor_speeds(wrong),
    ]
    if wrong is not None:  # which stands for the scenario's altitude, and for the present heading
        commands += [lambda: uav.take_off(wrong), lambda: uav.go_to([1.0, 0.0, 2.0], wrong)]
    for command in commands:
        with pytest.raises(CommandError):
            command()
    assert uav.mode.name == "LANDED"


def test_a_run_ends_at_its_duration(simulate, flat_data):
    flat_data["duration_s"] = 0.35
    simulation = simulate(flat_data)
    assert not simulation.clock.finished
    simulation.run()
    assert simulation.time_s == pytest.approx(0.35)
    assert simulation.clock.finished


def test_the_package_names_its_entrances():
    assert volery.__version__
    assert volery.load_scenario("hover").name == "hover"
    assert {"Scenario", "Simulation", "load_scenario"} <= set(volery.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = volery.nothing


def test_a_closed_simulation_says_so(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.close()
    simulation.close()
    with pytest.raises(CommandError, match="closed"):
        simulation.run(0.1)
    with pytest.raises(CommandError, match="closed"):
        simulation.step()


def test_other_threads_post_their_commands(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    done = simulation.post(lambda: uav.take_off(2.0))
    refused = simulation.post(lambda: uav.take_off(2.0))
    broken = simulation.post(lambda: 1 / 0)
    cancelled = simulation.post(uav.land)
    assert cancelled.cancel()
    assert not done.done()
    simulation.run(1.0)
    assert done.result().command == "take_off"
    assert isinstance(refused.exception(), CommandError)
    assert isinstance(broken.exception(), ZeroDivisionError)
    assert uav.position_map[2] > 0.3


def test_velocities_do_not_cut_a_take_off_short(simulate, flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    simulation = simulate(flat_data)
    twist = simulation.graph.advertise("/uav1/cmd_vel", Twist)
    for _ in range(50):
        twist.publish(Twist(Vector3(0.5, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        twist.publish(Twist(None, None))
        simulation.run(0.1)
    assert simulation.uavs["uav1"].position_map[2] > 2.0


def fall_past_a_lidar(simulate, rate_hz):
    """Scans of a LIDAR whose beams sweep the ground while its UAV falls."""
    data = {
        "name": "fall",
        "physics": {"rate_hz": rate_hz},
        "types": {"f450": {"sensors": [{"kind": "lidar", "rpy_deg": [0, 90, 0], "noise": False}]}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 15.0]}],
    }
    simulation = simulate(data)
    simulation.uavs["uav1"].command_rotor_speeds([0.0] * 4)
    scans = []
    simulation.graph.subscribe(
        "/uav1/laser/horizontal/scan", lambda m: scans.append(m.message.ranges)
    )
    simulation.run(0.6)
    return np.array(scans)


def test_every_physics_rate_leaves_the_sweep_its_poses(simulate):
    reference = fall_past_a_lidar(simulate, 1000)
    beams = slice(300, 780)  # those that meet the ground near by
    assert np.isfinite(reference[:, beams]).all()
    for rate_hz in (500, 4000):
        scans = fall_past_a_lidar(simulate, rate_hz)
        np.testing.assert_allclose(scans[:, beams], reference[:, beams], atol=0.01)


@pytest.mark.parametrize(
    ("where", "words"),
    [("constructor", "does not start"), ("timer", "in its timer"), ("message", "message on")],
)
def test_a_failing_node_is_named(simulate, flat_data, tmp_path, monkeypatch, where, words):
    (tmp_path / f"bad_{where}.py").write_text(
        "from volery.graph.messages import Range\n"
        "from volery.graph.nodes.node import Node\n"
        "class Bad(Node):\n"
        "    def __init__(self, **options):\n"
        "        super().__init__('bad', **options)\n"
        f"        if '{where}' == 'constructor': {{}}['x']\n"
        "        self.create_timer(0.1, self.tick)\n"
        "        self.create_subscription(Range, 'range', self.receive, 1)\n"
        f"    def tick(self):\n        if '{where}' == 'timer': 1 / 0\n"
        f"    def receive(self, _):\n        if '{where}' == 'message': 1 / 0\n"
    )
    monkeypatch.chdir(tmp_path)  # the working folder is searched for modules
    flat_data["types"]["f450"]["nodes"] = [{"node": f"bad_{where}:Bad"}]
    with pytest.raises(VoleryError, match=words):
        simulate(flat_data).run(0.2)


# ------------------------------------------------------------------------- trajectories and plants


def trajectory(points, frame="map"):
    """A MultiDOFJointTrajectory of (time, position, velocity) for the vehicle."""
    zero = Vector3(0.0, 0.0, 0.0)
    made = [
        MultiDOFJointTrajectoryPoint(
            [Transform(Vector3(*map(float, position)), Quaternion(0.0, 0.0, 0.0, 1.0))],
            [Twist(Vector3(*map(float, velocity)), zero)],
            [],
            Duration(int(t), round(1e9 * (t % 1))),
        )
        for t, position, velocity in points
    ]
    return MultiDOFJointTrajectory(header(0, frame), ["base_link"], made)


def test_a_trajectory_message_is_flown(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 20.0]
    simulation = simulate(flat_data)
    publisher = simulation.graph.advertise("/uav1/trajectory", MultiDOFJointTrajectory)
    uav = simulation.uavs["uav1"]
    publisher.publish(trajectory([(0, (9, 9, 9), (0, 0, 0))], frame="odom"))
    simulation.run(0.1)
    assert uav.mode.name == "HOLD"  # not in the map: ignored
    publisher.publish(
        trajectory(
            [(0, (0, 0, 20), (0, 0, 0)), (2.5, (3, 0, 21), (1, 0, 0)), (5, (4, 0, 21), (0,) * 3)]
        )
    )
    simulation.run(2.6)
    assert uav.mode.name == "TRAJECTORY"
    np.testing.assert_allclose(uav.position_map, (3, 0, 21), atol=0.25)
    simulation.run(4.0)
    assert uav.mode.name == "HOLD"
    np.testing.assert_allclose(uav.position_map, (4, 0, 21), atol=0.05)


def test_one_point_is_a_setpoint_and_a_late_one_a_goal(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 20.0]
    simulation = simulate(flat_data)
    publisher = simulation.graph.advertise("/uav1/trajectory", MultiDOFJointTrajectory)
    uav = simulation.uavs["uav1"]
    publisher.publish(trajectory([(0, (0, 0, 20), (1, 0, 0))]))
    simulation.run(0.4)
    assert uav.mode.name == "TRAJECTORY"
    simulation.run(0.4)
    assert uav.mode.name == "HOLD"  # nothing came after it
    publisher.publish(trajectory([(4, (2, 3, 22), (0, 0, 0))]))
    simulation.run(7.0)
    np.testing.assert_allclose(uav.position_map, (2, 3, 22), atol=0.05)


def test_plants_of_a_scenario(simulate, flat_data):
    flat_data["types"]["f450"]["plant"] = "identified"
    flat_data["types"]["mover"] = {"plant": "kinematic"}
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0]},
        {"type": "mover", "position_m": [5.0, 0.0, 10.0]},
    ]
    simulation = simulate(flat_data)
    real, mover = simulation.uavs.values()
    real.take_off(3.0)
    mover.command_pose((5, 5, 10), (0, 0, 0, 1))
    simulation.run(0.5)
    np.testing.assert_array_equal(mover.position_map, (5, 5, 10))
    mover.command_velocity((2, 0, 0))
    simulation.run(0.4)
    np.testing.assert_allclose(mover.position_map, (5.8, 5, 10), atol=1e-9)
    simulation.run(6.0)
    assert real.position_map[2] == pytest.approx(3.12, abs=0.05)


def test_poses_on_the_topic_move_odometry_and_imu(simulate, flat_data):
    """What a game engine sends: poses of 2 m/s at 50 Hz, no velocity."""
    flat_data["types"]["mover"] = {
        "plant": "kinematic",
        "sensors": [{"kind": "ground_truth"}, {"kind": "odometry"}, {"kind": "imu"}],
    }
    flat_data["uavs"] = [{"type": "mover", "position_m": [0.0, 0.0, 4.0]}]
    simulation = simulate(flat_data)
    twists, forces = {"ground_truth/odom": [], "odom": []}, []
    for name, received in twists.items():
        simulation.graph.subscribe(
            f"/uav1/{name}",
            lambda p, received=received: received.append(p.message.twist.twist.linear.x),
            Odometry,
        )
    simulation.graph.subscribe(
        "/uav1/imu", lambda p: forces.append(p.message.linear_acceleration.x), Imu
    )
    poses = simulation.graph.advertise("/uav1/pose_command", PoseStamped)
    for k in range(60):
        stamp = header(20_000_000 * k, "map")
        position = Point(0.04 * k, 0.0, 4.0)
        poses.publish(PoseStamped(stamp, Pose(position, Quaternion(0.0, 0.0, 0.0, 1.0))))
        simulation.run(0.02)
    for received in twists.values():
        assert received[-1] == pytest.approx(2.0, abs=0.1)
    assert np.abs(forces).max() < 105.0
    assert np.abs(forces[-20:]).max() < 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"plant": "identified", "identified_model": "f449"}, "types.f450.identified_model.*f450"),
        ({"identified_model": "f450"}, 'needs plant = "identified"'),
        ({"kinematic": {"limited": True}}, 'needs plant = "kinematic"'),
        ({"plant": "rigid"}, "rigid_body"),
    ],
)
def test_wrong_plants_are_refused(simulate, flat_data, changes, words):
    flat_data["types"]["f450"] |= changes
    with pytest.raises(VoleryError, match=words):
        simulate(flat_data)
