"""People, cars and birds in a flight: every sensor sees them, UAVs hit them, clients move them."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError, SpawnError
from volery.engine.events import EventKind
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Header, Point, Pose, PoseStamped, Quaternion, time_from_ns
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario
from volery.world.materials import Material

SCAN = "/uav1/laser/horizontal/scan"


def outside(name="van", shape="car", position=(6.0, 0.0), yaw_deg=0.0):
    motion = {"kind": "external", "position_m": list(position), "yaw_deg": yaw_deg}
    return {"name": name, "shape": shape, "motion": motion}


@pytest.fixture
def actors_data():
    return {
        "name": "street",
        "physics": {"on_contact": "bounce"},
        "world": {"actors": [outside()]},
        "types": {
            "f450": {
                "sensors": [
                    {"kind": "lidar", "noise": False},
                    {"kind": "imu"},
                    {"kind": "ground_truth"},
                    {
                        "kind": "sonar",
                        "position_m": [0.0, 0.0, -0.05],
                        "rpy_deg": [0.0, 90.0, 0.0],
                        "noise": False,
                    },
                    {"kind": "camera", "width": 64, "height": 48, "noise": False},
                ]
            }
        },
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 0.7]}],
    }


def listen(simulation, topic):
    got = []
    simulation.graph.subscribe(topic, lambda m: got.append(m.message))
    return got


def ahead(scan):
    ranges = np.asarray(scan.ranges)
    return float(ranges[len(ranges) // 2])


def test_lidars_cameras_and_sonars_see_them(simulate, actors_data):
    actors_data["types"]["f450"]["plant"] = "kinematic"
    actors_data["uavs"][0]["position_m"] = [0.0, 0.0, 0.7]
    simulation = simulate(actors_data)
    scans, ranges = listen(simulation, SCAN), listen(simulation, "/uav1/range")
    depth = listen(simulation, "/uav1/camera/depth")
    labels = listen(simulation, "/uav1/camera/labels/material")
    simulation.run(0.3)
    assert ahead(scans[-1]) == pytest.approx(6.0 - 2.2, abs=1e-3)
    middle = np.frombuffer(depth[-1].data, np.float32).reshape(48, 64)[24, 32]
    assert middle == pytest.approx(3.8, abs=1e-2)
    materials = np.frombuffer(labels[-1].data, np.uint8).reshape(48, 64)
    assert {Material.CAR_PAINT, Material.RUBBER} <= set(materials.ravel().tolist())
    on_ground = ranges[-1].range
    simulation.world.set_actor_pose("van", [0.0, 0.0, -1.2])  # its roof is below the UAV now
    simulation.run(0.3)
    assert on_ground == pytest.approx(0.65, abs=0.05)
    assert ranges[-1].range == pytest.approx(0.65 - 0.25, abs=0.05)


def test_a_walker_is_seen_where_it_is_at_the_beams_own_time(simulate, actors_data):
    actors_data["world"]["actors"] = [
        {
            "name": "runner",
            "shape": "car",
            "motion": {
                "kind": "waypoints",
                "waypoints_m": [[10.0, 0.0], [60.0, 0.0]],
                "speed_m_s": 20.0,
                "at_end": "stop",
            },
        }
    ]
    actors_data["types"]["f450"]["plant"] = "kinematic"
    simulation = simulate(actors_data)
    scans = []
    simulation.graph.subscribe(SCAN, scans.append)
    simulation.run(0.5)
    for published in scans:
        message = published.message
        stamp_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        beam = len(message.ranges) // 2
        time_s = stamp_s + beam * message.time_increment
        # A packet of beams sees bodies at one time: that of its middle, a third of a ms away.
        want = 10.0 + 20.0 * time_s - 2.2
        assert ahead(message) == pytest.approx(want, abs=20.0 * 2e-4)


def meet(simulate, data, **change):
    data = copy.deepcopy(data)
    data.update(change)
    simulation = simulate(data)
    simulation.run(3.0)
    return simulation, [e for e in simulation.diagnostics.events if e.kind is EventKind.COLLISION]


def test_a_uav_rests_on_a_tag_without_a_contact(simulate, actors_data):
    tag = {"name": "pad", "shape": "tag", "tag": {"id": 3}, "motion": outside()["motion"]}
    actors_data["world"]["actors"] = [tag]
    actors_data["uavs"][0]["position_m"] = [6.0, 0.0]
    _simulation, hits = meet(simulate, actors_data)
    assert not hits


def test_what_drives_into_a_hovering_uav_hits_it(simulate, actors_data):
    drive = {
        "kind": "waypoints",
        "waypoints_m": [[-12.0, 0.0], [12.0, 0.0]],
        "speed_m_s": 10.0,
        "at_end": "stop",
    }
    actors_data["world"]["actors"] = [{"name": "truck", "shape": "car", "motion": drive}]
    simulation, hits = meet(simulate, actors_data)
    first = hits[0]
    radius = simulation.uavs["uav1"].airframe.body.collision_radius_m
    assert (first.uav, first.partner) == ("uav1", "truck")
    # Its front reaches the UAV's sphere at 12 m - 2.2 m - radius of its path.
    assert first.time_ns * 1e-9 == pytest.approx((12.0 - 2.2 - radius) / 10.0, abs=0.02)
    assert first.speed_m_s == pytest.approx(10.0, abs=0.2)
    assert simulation.uavs["uav1"].position_map[0] > 1.0  # thrown ahead


def test_a_uav_that_flies_into_an_actor_crashes(simulate, actors_data):
    actors_data["physics"] = {"on_contact": "crash"}
    actors_data["types"]["f450"]["plant"] = "rigid_body"
    simulation = simulate(actors_data)
    uav = simulation.uavs["uav1"]
    uav.go_to([12.0, 0.0, 0.8])
    simulation.run(6.0)
    hit = next(e for e in simulation.diagnostics.events if e.kind is EventKind.COLLISION)
    assert hit.partner == "van"
    assert uav.crashed
    assert hit.position_map[0] == pytest.approx(
        6.0 - 2.2 - uav.airframe.body.collision_radius_m, abs=0.05
    )
    assert uav.position_map[0] < 4.0


def test_a_bird_that_passes_near_by_is_no_contact(simulate, actors_data):
    circle = {"kind": "circle", "centre_m": [0, 0, 0.7], "radius_m": 1.2, "speed_m_s": 3.0}
    actors_data["world"]["actors"] = [{"name": "gull", "shape": "bird", "motion": circle}]
    _, hits = meet(simulate, actors_data)
    assert not hits
    circle["radius_m"] = 0.5
    _, hits = meet(simulate, actors_data)
    assert hits
    assert hits[0].partner == "gull"


def busy(data):
    """Three UAVs among actors of all kinds, which collide now and then."""
    data["physics"] = {"on_contact": "bounce"}
    data["types"]["f450"]["sensors"] = data["types"]["f450"]["sensors"][:3]
    data["uavs"] = [
        {
            "type": "f450",
            "count": 3,
            "position_m": [0.0, 0.0, 1.2],
            "last_position_m": [0.0, 6.0],
        }
    ]
    walk = {"kind": "waypoints", "waypoints_m": [[-2, -2], [2, 8]], "speed_m_s": 2.0}
    fly = {"kind": "circle", "centre_m": [0, 3, 1.2], "radius_m": 3.0, "speed_m_s": 4.0}
    data["world"]["actors"] = [
        {"name": "anna", "shape": "person", "motion": {**walk, "at_end": "back"}},
        {"name": "gull", "shape": "bird", "motion": fly},
        outside(position=(3.0, 0.0)),
    ]
    return data


def test_digests_do_not_depend_on_slices_or_threads(simulate, actors_data):
    def fly(step, **options):
        simulation = simulate(busy(actors_data), **options)
        simulation.diagnostics.enable_digest()
        while simulation.time_ns < 4_000_000_000:
            if simulation.time_ns == 2_000_000_000:
                simulation.world.set_actor_pose("van", [1.0, 2.0, 0.0], None, [-0.5, 0.0, 0.0])
            simulation.step(step)
        partners = {
            e.partner for e in simulation.diagnostics.events if e.kind is EventKind.COLLISION
        }
        return simulation.diagnostics.digest(), partners

    digest, partners = fly(1000)
    assert fly(8) == (digest, partners)
    assert fly(400, threads=2) == (digest, partners)
    assert {"gull", "van"} <= partners


def test_snapshots_keep_actors_and_contacts(simulate, actors_data):
    simulation = simulate(busy(actors_data))
    simulation.diagnostics.enable_digest()
    simulation.world.set_actor_pose("van", [1.0, 2.0, 0.0], None, [-0.5, 0.0, 0.0])
    simulation.run(1.0)
    kept = simulation.snapshot()
    simulation.run(1.5)
    want = simulation.diagnostics.digest()
    simulation.world.set_actor_pose("van", [50.0, 0.0, 0.0])
    simulation.run(0.5)
    simulation.restore(kept)
    simulation.run(1.5)
    assert simulation.diagnostics.digest() == want
    simulation.reset()
    assert simulation.world.actors.poses_at(0)[2, :3].tolist() == [3.0, 0.0, 0.0]


def test_uavs_come_and_go_among_actors(simulate, actors_data):
    simulation = simulate(actors_data)
    scans = listen(simulation, SCAN)
    simulation.run(0.2)
    simulation.vehicles.spawn("scout", "crazyflie", [2.0, 0.0, 0.7])
    simulation.run(0.2)
    assert ahead(scans[-1]) < 2.0  # the newcomer
    simulation.vehicles.delete("scout")
    simulation.run(0.2)
    assert ahead(scans[-1]) == pytest.approx(3.8, abs=0.05)
    assert simulation.world.scene.instance_name(simulation.world.scene.moving_offset + 1) == "van"
    with pytest.raises(SpawnError, match="there is an actor 'van'"):
        simulation.vehicles.spawn("van", "crazyflie", [2.0, 0.0, 0.7])


def test_copies_see_them_too(actors_data):
    actors_data["types"]["f450"]["plant"] = "kinematic"
    actors_data["types"]["f450"]["sensors"] = actors_data["types"]["f450"]["sensors"][:2]
    with VectorizedSimulation(parse_scenario(actors_data), 3) as envs:
        envs.run(0.1)
        ranges = envs.sample("uav1", "horizontal")["echoes"][:, 0]
        middle = ranges[:, ranges.shape[1] // 2]
        np.testing.assert_allclose(middle, 3.8, atol=1e-3)


# ------------------------------------------------------------------------------------- the graph


def call(simulation, service, **fields):
    request = zero_message(f"{simulation.graph.services()[service]}_Request")
    for key, value in fields.items():
        setattr(request, key, value)
    return simulation.graph.call(service, request)


def test_they_are_entities(simulate, actors_data):
    walk = {"kind": "waypoints", "waypoints_m": [[0, 5], [9, 5]], "speed_m_s": 1.0}
    actors_data["world"]["actors"].append({"name": "anna", "shape": "person", "motion": walk})
    simulation = simulate(actors_data)
    simulation.run(0.1)
    assert call(simulation, "/get_entities").entities == ["uav1", "van", "anna"]
    request = zero_message("simulation_interfaces/srv/GetEntities_Request")
    human = zero_message("simulation_interfaces/msg/EntityCategory")
    human.category = 2
    request.filters.categories = [human]
    assert simulation.graph.call("/get_entities", request).entities == ["anna"]
    info = call(simulation, "/get_entity_info", entity="van").info
    assert (info.category.category, info.tags) == (4, ["actor", "car"])
    bounds = call(simulation, "/get_entity_bounds", entity="van").bounds.points
    assert bounds[0].x - bounds[1].x == pytest.approx(4.4, abs=1e-5)
    state = call(simulation, "/get_entity_state", entity="anna").state
    assert state.pose.position.x == pytest.approx(0.1)
    assert state.twist.linear.x == pytest.approx(1.0)
    refused = call(simulation, "/delete_entity", entity="van")
    assert refused.result.result != 1


def test_they_are_put_by_the_standard(simulate, actors_data):
    simulation = simulate(actors_data)
    state = zero_message("simulation_interfaces/msg/EntityState")
    state.pose = Pose(Point(4.0, 1.0, 0.0), Quaternion(0.0, 0.0, 1.0, 0.0))
    state.twist.linear.x = 2.0
    both = {"entity": "van", "state": state, "set_pose": True, "set_twist": True}
    assert call(simulation, "/set_entity_state", **both).result.result == 1
    simulation.run(0.5)
    np.testing.assert_allclose(
        simulation.world.actors.poses_at(simulation.time_ns)[0],
        [5.0, 1.0, 0, 0, 0, 1, 0],
        atol=1e-9,
    )
    state.twist.angular.z = 1.0
    refused = call(simulation, "/set_entity_state", **both).result
    assert (refused.result, "do not turn" in refused.error_message) == (0, True)
    state.twist.angular.z, state.pose.position.x = 0.0, float("nan")
    assert "finite" in call(simulation, "/set_entity_state", **both).result.error_message


def test_a_topic_sets_their_poses_and_tf_publishes_them(simulate, actors_data):
    simulation = simulate(actors_data)
    transforms = listen(simulation, "/tf")
    sender = simulation.graph.advertise("/actors/van/pose", PoseStamped)

    def send(x, turn=(0.0, 0.0, 0.0, 1.0), frame="map"):
        pose = Pose(Point(x, 0.0, 0.0), Quaternion(*turn))
        sender.publish(PoseStamped(Header(time_from_ns(0), frame), pose))
        simulation.run(0.1)
        return simulation.world.actors.poses_at(simulation.time_ns)[0].tolist()

    assert send(9.0)[0] == 9.0
    assert send(10.0, (0.0, 0.0, 1.0, 0.0)) == [10.0, 0, 0, 0, 0, 1, 0]
    assert send(11.0, (0.0,) * 4) == [11.0, 0, 0, 0, 0, 1, 0]  # keeps its heading
    assert send(12.0, (5.0, 0.0, 0.0, 0.0))[0] == 11.0
    assert send(float("nan"))[0] == 11.0
    assert send(13.0, frame="odom")[0] == 11.0
    poses = [t for message in transforms for t in message.transforms if t.child_frame_id == "van"]
    assert len(poses) >= 25
    assert poses[-1].header.frame_id == "map"
    assert poses[-1].transform.translation.x == 11.0


@pytest.mark.parametrize(
    ("actors", "words"),
    [
        ([outside("uav7")], "UAV's name"),
        ([outside(), outside()], "used twice: van"),
        ([{**outside(), "shape": "boat"}], "person"),
        ([outside(position=(1.0,))], "position_m"),
        (
            [
                {
                    "name": "a",
                    "shape": "car",
                    "motion": {
                        "kind": "waypoints",
                        "waypoints_m": [[0, 0], [0, 0]],
                        "speed_m_s": 1,
                    },
                }
            ],
            "at least two must differ",
        ),
    ],
)
def test_scenarios_that_cannot_be_are_refused(actors_data, actors, words):
    actors_data["world"]["actors"] = actors
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(actors_data)
    assert words in str(caught.value)


def test_unknown_actors_cannot_be_put(simulate, actors_data, flat_data):
    with pytest.raises(CommandError, match="known: van"):
        simulate(actors_data).world.set_actor_pose("x", [0, 0, 0])
    with pytest.raises(CommandError, match="known: none"):
        simulate(flat_data).world.set_actor_pose("x", [0, 0, 0])
