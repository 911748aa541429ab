"""Tests LIDAR messages as other programs read them: bytes by field, logs, topics."""

import copy

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from volery.bridges.logs.log_writer import create_log
from volery.core.errors import DataFileError, ScenarioError
from volery.graph.typestore import typestore
from volery.sensors.lidar.lidar_model import load_lidar

NUMPY_TYPE = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4", 8: "<f8"}
"""Datatypes of sensor_msgs/PointField."""


def read_cloud(message):
    """Points of a PointCloud2 by nothing but its own description."""
    fields = {f.name: (NUMPY_TYPE[f.datatype], f.offset) for f in message.fields}
    kind = np.dtype(
        {
            "names": list(fields),
            "formats": [f[0] for f in fields.values()],
            "offsets": [f[1] for f in fields.values()],
            "itemsize": message.point_step,
        }
    )
    assert not message.is_bigendian
    assert message.row_step == message.point_step * message.width
    assert len(message.data) == message.row_step * message.height
    return np.frombuffer(np.asarray(message.data).tobytes(), dtype=kind)


@pytest.fixture
def flown(simulate, wood_data):
    """Messages of .5 s of standing UAVs with these LIDARs, by topic."""

    def fly(*lidars, seconds=0.5):
        data = copy.deepcopy(wood_data)
        data["types"]["surveyor"] = {"sensors": [{"kind": "lidar", **one} for one in lidars]}
        simulation = simulate(data)
        found = {}
        simulation.graph.subscribe_all(lambda m: found.setdefault(m.topic, []).append(m))
        simulation.run(seconds)
        return simulation, found

    return fly


def test_a_cloud_reads_back_by_its_own_description(flown):
    _, found = flown({"model": "os1_64", "position_m": [0.0, 0.0, 1.0]})
    clouds = found["/uav1/points"]
    assert [m.message.header.stamp.nanosec for m in clouds] == [k * 100e6 for k in range(5)]
    assert [m.time_ns for m in clouds] == [(k + 1) * 100e6 for k in range(5)]
    message = typestore().deserialize_cdr(clouds[1].cdr, "sensor_msgs/msg/PointCloud2")
    assert message.header.frame_id == "uav1/laser_horizontal"
    assert [f.name for f in message.fields] == ["x", "y", "z", "intensity", "ring", "time"]
    assert [f.offset for f in message.fields] == [0, 4, 8, 12, 16, 18]
    assert (message.point_step, message.height, message.is_dense) == (22, 1, True)
    points = read_cloud(message)
    model = load_lidar("os1_64")
    xyz = np.stack([points["x"], points["y"], points["z"]]).astype(float)
    assert np.isfinite(xyz).all()
    assert len(points) > 10_000
    # Ranges of whole resolution steps, along the beams that ring and time name.
    ranges = np.linalg.norm(xyz, axis=0)
    steps = ranges / model.range.resolution_m
    np.testing.assert_allclose(steps, np.round(steps), atol=0.01)
    column = np.round(points["time"].astype(float) / model.scan.column_period_s).astype(int)
    beam = column * 64 + points["ring"]
    assert (np.diff(beam) > 0).all()
    np.testing.assert_allclose(xyz / ranges, model.scan.directions(1)[:, beam], atol=2e-6)
    assert points["intensity"].max() > 0.0


def test_several_clouds_a_uav_have_topics_of_their_own(flown):
    simulation, found = flown(
        {"name": "top", "model": "vlp_16"},
        {"name": "front", "model": "mid_40", "topic": "livox/points", "phase_s": 0.05},
        {"name": "level"},
    )
    assert set(simulation.vehicles.lidar_mounts) == {f"/uav{n}/laser/level/scan" for n in (1, 2)}
    assert set(simulation.vehicles.point_cloud_mounts) == {
        f"/uav{n}/{topic}" for n in (1, 2) for topic in ("points", "livox/points")
    }
    assert found["/uav2/points"][0].message.header.frame_id == "uav2/laser_top"
    assert found["/uav2/livox/points"][0].message.header.frame_id == "uav2/laser_front"
    frames = {t.child_frame_id for t in found["/tf_static"][0].message.transforms}
    assert {"uav1/laser_top", "uav1/laser_front", "uav1/laser_level"} <= frames
    first, second = (read_cloud(m.message) for m in found["/uav1/livox/points"][:2])
    assert len(first) != len(second) or (first["y"] != second["y"]).any()


def test_two_clouds_on_one_topic_are_refused(flown):
    with pytest.raises(ScenarioError, match=r"'a' and 'b' both publish on /uav1/points"):
        flown({"name": "a", "model": "vlp_16"}, {"name": "b", "model": "mid_40"})


def test_echoes_beside_scans(flown):
    _, found = flown({"name": "ew", "model": "utm_30lx_ew"}, seconds=0.2)
    scans, several = found["/uav1/laser/ew/scan"], found["/uav1/laser/ew/echoes"]
    assert len(scans) == len(several) > 5
    scan = scans[-1].message
    assert scan.intensities.shape == scan.ranges.shape
    message = typestore().deserialize_cdr(several[-1].cdr, "sensor_msgs/msg/MultiEchoLaserScan")
    assert len(message.ranges) == len(message.intensities) == 1081
    first = np.array([beam.echoes[0] for beam in message.ranges])
    np.testing.assert_array_equal(first, scan.ranges)
    counts = np.array([len(beam.echoes) for beam in message.ranges])
    assert set(counts.tolist()) <= {1, 2, 3}
    for beam, strength in zip(message.ranges, message.intensities, strict=True):
        assert len(beam.echoes) == len(strength.echoes)
        assert (np.diff(beam.echoes) > 0).all()


def test_planar_intensities_are_there_when_asked_for(flown):
    _, found = flown(
        {"name": "bare"}, {"name": "rich", "intensities": True, "phase_s": 0.005}, seconds=0.1
    )
    assert len(found["/uav1/laser/bare/scan"][0].message.intensities) == 0
    rich = found["/uav1/laser/rich/scan"][0].message
    seen = np.isfinite(rich.ranges)
    assert (rich.intensities[seen] > 0.0).all()
    assert (rich.intensities[~seen] == 0.0).all()


def test_intensities_need_a_model_with_them(flown, tmp_path):
    from pathlib import Path

    import volery.sensors

    text = (Path(volery.sensors.__file__).parent / "models/utm_30lx.toml").read_text()
    (tmp_path / "plain.toml").write_text(text[: text.index("[intensity]")])
    with pytest.raises(DataFileError, match=r"no \[intensity\]"):
        flown({"model": str(tmp_path / "plain.toml"), "intensities": True})


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_logs_carry_clouds_and_echoes(flown, tmp_path, suffix):
    _, found = flown({"name": "a", "model": "vlp_16"}, {"name": "ew", "model": "utm_30lx_ew"})
    topics = ("/uav1/points", "/uav1/laser/ew/echoes")
    sent = [m for topic in topics for m in found[topic]]
    log = create_log(tmp_path / f"flight{suffix}")
    for message in sent:
        log.write(message)
    log.close()
    with AnyReader([tmp_path / f"flight{suffix}"], default_typestore=typestore()) as reader:
        read = {topic: [] for topic in topics}
        for connection, _, data in reader.messages():
            read[connection.topic].append(reader.deserialize(data, connection.msgtype))
    for message, want in zip(read[topics[0]], found[topics[0]], strict=True):
        assert read_cloud(message).tobytes() == read_cloud(want.message).tobytes()
    for message, want in zip(read[topics[1]], found[topics[1]], strict=True):
        for got, sent_echo in zip(message.ranges, want.message.ranges, strict=True):
            np.testing.assert_array_equal(got.echoes, sent_echo.echoes)
