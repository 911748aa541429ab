"""Tests returns for display: few, in the UAV's frame, corrected for mount and nodding."""

import copy
import math

import numpy as np
import pytest

from volery.graph.typestore import typestore
from volery.sensors.lidar.lidar_model import load_lidar


def read(message):
    assert [(f.name, f.offset, f.datatype) for f in message.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
    ]
    assert (message.point_step, message.height, message.is_bigendian) == (12, 1, False)
    assert message.row_step == 12 * message.width == len(message.data)
    return np.frombuffer(np.asarray(message.data).tobytes(), "<f4").reshape(-1, 3)


@pytest.fixture
def watch(simulate, wood_data):
    """Returns and scans of one UAV that hangs still in the air, by name."""

    def fly(*lidars, seconds=0.6):
        data = copy.deepcopy(wood_data)
        data["world"].pop("wind")
        data["types"]["surveyor"] = {
            "plant": "kinematic",
            "sensors": [{"kind": "lidar", "noise": False, **one} for one in lidars],
        }
        data["uavs"] = [{"type": "surveyor", "position_m": [50.0, 50.0, 2.5]}]
        simulation = simulate(data)
        session = simulation.gateway.open("page")
        names = [one["name"] for one in lidars]
        boxes = {
            (name, what): session.subscribe(
                f"/uav1/laser/{name}/{what}", kind, depth=1000, wake=lambda: None
            )
            for name in names
            for what, kind in (
                ("points", "sensor_msgs/msg/PointCloud2"),
                ("scan", "sensor_msgs/msg/LaserScan"),
            )
        }
        simulation.run(seconds)
        return simulation, {
            key: [typestore().deserialize_cdr(p.cdr, p.msgtype) for p in box.take()]
            for key, box in boxes.items()
        }

    return fly


def test_a_level_scanner_seen_from_its_uav(watch):
    mount = [0.1, -0.2, 0.18]
    _, got = watch({"name": "horizontal", "position_m": mount, "rpy_deg": [0.0, 0.0, 90.0]})
    points, scans = got["horizontal", "points"], got["horizontal", "scan"]
    assert len(points) == len(scans) > 10
    cloud, scan = points[3], scans[3]
    assert cloud.header.frame_id == "uav1/base_link"
    middle_ns = scan.header.stamp.nanosec + round(0.5e9 * scan.time_increment * 1080)
    assert cloud.header.stamp.nanosec == pytest.approx(middle_ns, abs=1000)
    step = math.ceil(len(scan.ranges) / 360)
    beams = np.arange(0, len(scan.ranges), step)
    ranges = scan.ranges[beams]
    angles = scan.angle_min + beams * scan.angle_increment + math.pi / 2.0
    expected = np.stack(
        [ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(beams))], axis=-1
    ) + np.array(mount)
    seen = read(cloud)
    assert 20 < len(seen) <= 360
    assert seen == pytest.approx(expected[np.isfinite(ranges)], abs=1e-4)


def test_a_nodding_scanner_puts_the_ground_where_it_is(watch):
    """The ground stays level and where it is, whatever the mount's angle was; it looks up too."""
    simulation, got = watch(
        {
            "name": "nodding",
            "position_m": [0.1, 0.0, -0.08],
            "nodding": {"amplitude_deg": 40.0, "period_s": 0.5},
        },
        seconds=1.0,
    )
    height = simulation.uavs["uav1"].position_map[2]
    clouds = [read(cloud) for cloud in got["nodding", "points"]]
    everything = np.concatenate(clouds)
    ground = everything[everything[:, 2] < -height + 0.05]
    assert len(ground) > 1000
    assert ground[:, 2] == pytest.approx(-height, abs=5e-3)
    ahead = [cloud[cloud[:, 0] > 0.2] for cloud in clouds]
    lowest = [part[:, 2].min(initial=1.0) for part in ahead]
    assert min(lowest) < -height + 0.05
    assert max(lowest) > 0.0  # nothing ahead is below it while it looks up


def test_all_rings_of_a_spinning_scanner_are_shown(watch):
    _, got = watch({"name": "front", "model": "vlp_16", "position_m": [0.0, 0.0, 0.2]})
    model = load_lidar("vlp_16")
    seen = read(got["front", "points"][0]) - np.array([0.0, 0.0, 0.2])
    assert 200 < len(seen) <= 2048
    elevation = np.degrees(np.arcsin(seen[:, 2] / np.linalg.norm(seen, axis=1)))
    downward = [e for e in model.scan.elevation_deg if e < 0.0]
    for ring in downward:
        assert np.abs(elevation - ring).min() < 0.05


def test_only_external_clients_receive_returns_and_they_end_with_their_uav(simulate, wood_data):
    simulation = simulate(wood_data)
    topics = set()
    simulation.graph.subscribe_all(lambda m: topics.add(m.topic))
    topic = "/uav1/laser/nodding/points"
    box = simulation.gateway.open("page").subscribe(topic, wake=lambda: None)
    simulation.run(0.2)
    assert box.take()
    assert topic not in topics
    assert "/uav1/laser/nodding/scan" in topics
    simulation.vehicles.delete("uav1")
    simulation.run(0.2)
    assert box.take() == []
    assert simulation.graph.publishers(topic) == 0
