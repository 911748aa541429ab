"""The mapping nodes on sensor messages alone, good and bad ones."""

import copy
import json

import numpy as np
import pytest
from node_bench import NodeBench, nod, odometry, scan

from volery.autonomy.mapping.mapping_node import Mapping
from volery.autonomy.mapping.merging_node import MapMerging
from volery.autonomy.mapping.messages import octomap_message
from volery.autonomy.mapping.octomap_stream import decode_binary
from volery.autonomy.perception.motion_history import MotionHistory, NodHistory
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.scan_rays import Beams, RayMaker
from volery.core import rotations
from volery.core.errors import GraphError, NodeError
from volery.graph.messages import (
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
    message_type,
)

S = 1_000_000_000
MS = 1_000_000
BY_NAME = message_type("volery_interfaces/srv/ByName_Request")
TRIGGER = message_type("std_srvs/srv/Trigger_Request")
ROOM = 4.0  # a square room around the origin, its walls so far away


def room_scan(time_ns, position=(0.0, 0.0), yaw=0.0, beams=720):
    angle = np.linspace(-np.pi, np.pi, beams) + yaw
    with np.errstate(divide="ignore"):
        along = [
            (np.copysign(ROOM, f(angle)) - p) / f(angle)
            for f, p in zip((np.cos, np.sin), position, strict=True)
        ]
    noise = 1e-3 * np.sin(time_ns * 1e-9)  # no two scans are alike
    return scan(time_ns, np.minimum(*along) + noise)


def fly(bench, seconds, make=room_scan, begin_ns=0, height=3.0):
    """Stand in the room; the level LIDAR sees it, the nodding one likewise."""
    for k in range(round(seconds / 0.02)):
        now = begin_ns + k * 20 * MS
        bench.run_to(now)
        bench.send("/uav1/odom", odometry(now, (0.0, 0.0, height)))
        bench.send("/uav1/joint_states", nod(now, 0.0))
        if k % 2:
            bench.send("/uav1/laser/horizontal/scan", make(now - 15 * MS))
            bench.send("/uav1/laser/nodding/scan", make(now - 15 * MS))


def mapping(bench, **parameters):
    return bench.start(
        Mapping, odometry="odom", use_map_tf=False, voxels_period_s=1.0, **parameters
    )


def last_status(messages):
    return json.loads(messages[-1].data)


# ------------------------------------------------------------------------------------ motion, rays


def test_each_beam_is_cast_from_where_it_was():
    motion = MotionHistory()
    turn, speed = 0.8, 3.0  # rad/s, m/s
    for k in range(6):
        t = 0.02 * k
        q = rotations.from_rpy(0.1, -0.2, turn * t)
        motion.add(
            OdometrySample(
                round(t * S), np.array([speed * t, 0.0, 1.0]), q, np.zeros(3), np.zeros(3)
            )
        )
    ranges = np.full(101, 5.0)
    made = RayMaker([0.1, 0.0, -0.08], Beams()).rays(
        scan(11 * MS, ranges, -1.0, 1.0, 0.05), motion, None
    )
    for beam in (0, 37, 100):
        t = 0.011 + 0.05 * beam / 100
        q = rotations.from_rpy(0.1, -0.2, turn * t)
        angle = -1.0 + 0.02 * beam
        start = np.array([speed * t, 0.0, 1.0]) + rotations.rotate(q, [0.1, 0.0, -0.08])
        end = start + rotations.rotate(q, [5.0 * np.cos(angle), 5.0 * np.sin(angle), 0.0])
        np.testing.assert_allclose(made.starts[beam], start, atol=2e-3)
        np.testing.assert_allclose(made.ends[beam], end, atol=6e-3)
    assert made.hits.all()


def test_a_nodding_mount_looks_down_where_its_angle_is_positive():
    motion, nods = MotionHistory(), NodHistory()
    for k in range(4):
        motion.add(
            OdometrySample(k * 20 * MS, np.zeros(3), rotations.IDENTITY, np.zeros(3), np.zeros(3))
        )
        nods.add(k * 20 * MS, 0.5 + 0.1 * k, 5.0)
    maker = RayMaker([0.0, 0.0, 0.0], Beams())
    made = maker.rays(scan(0, np.full(3, 2.0), 0.0, 0.0, 0.04), motion, nods)
    for row, tilt in enumerate((0.5, 0.6, 0.7)):
        expected = [2.0 * np.cos(tilt), 0.0, -2.0 * np.sin(tilt)]
        np.testing.assert_allclose(made.ends[row], expected, atol=1e-6)


def test_ranges_that_are_none():
    motion = MotionHistory()
    for k in range(3):
        motion.add(
            OdometrySample(k * 20 * MS, np.zeros(3), rotations.IDENTITY, np.zeros(3), np.zeros(3))
        )
    ranges = [np.nan, -np.inf, 0.1, 3.0, np.inf, 20.0, 0.0, -1.0]
    made = RayMaker([0.0] * 3, Beams()).rays(scan(0, ranges), motion, None)
    np.testing.assert_array_equal(made.hits, [True, False, False])
    np.testing.assert_allclose(np.linalg.norm(made.ends, axis=1), [3.0, 5.0, 15.0], rtol=1e-6)
    assert RayMaker([0.0] * 3, Beams()).rays(scan(0, []), motion, None) is None


def test_motion_that_cannot_be_used_is_left_out():
    motion = MotionHistory()

    def pose(t, x):
        return OdometrySample(
            t, np.array([x, 0.0, 0.0]), rotations.IDENTITY, np.zeros(3), np.zeros(3)
        )

    assert motion.at(0) is None
    assert motion.add(pose(S, 1.0))
    assert not motion.add(pose(S, 2.0))  # repeated
    assert not motion.add(pose(S - 20 * MS, 0.9))  # out of order
    assert not motion.add(pose(2 * S, np.nan))
    assert motion.add(pose(S + 100 * MS, 2.0))
    assert motion.at(S + 50 * MS).position[0] == pytest.approx(1.5)
    assert motion.at(S - 1) is None
    assert motion.at(3 * S) is None
    assert motion.refused == 3
    assert motion.add(pose(5 * MS, 7.0))  # the clock was set back
    assert motion.newest.position[0] == 7.0
    assert motion.add(pose(4 * S, 0.0))
    assert motion.at(2 * S) is None  # too long a gap to interpolate


# ------------------------------------------------------------------------------------ the node


def test_the_room_stands_in_both_maps():
    bench = NodeBench()
    mapping(bench)
    voxels, grids = bench.listen("/uav1/octomap_binary"), bench.listen("/uav1/projected_map")
    fly(bench, 2.2)
    message = voxels[-1]
    assert (message.binary, message.id, message.resolution) == (True, "OcTree", 0.2)
    assert message.header.frame_id == "map"
    cubes = decode_binary(np.asarray(message.data).view(np.uint8))
    middles = (cubes.corner[cubes.occupied] + 0.5 * cubes.side[cubes.occupied, None]) * 0.2
    off = np.abs(np.abs(middles[:, :2]).max(axis=1) - ROOM)
    assert off.max() < 0.25
    grid = grids[-1]
    values = np.asarray(grid.data).reshape(grid.info.height, grid.info.width)
    rows, columns = np.nonzero(values == 100)
    x = grid.info.origin.position.x + (columns + 0.5) * grid.info.resolution
    y = grid.info.origin.position.y + (rows + 0.5) * grid.info.resolution
    assert np.abs(np.maximum(np.abs(x), np.abs(y)) - ROOM).max() < 0.45
    assert (values == 0).sum() * grid.info.resolution**2 > 40.0


def test_it_says_what_is_wrong():
    bench = NodeBench()
    mapping(bench)
    statuses = bench.listen("/uav1/mapping/status")
    bench.run_to(S)
    assert last_status(statuses)["problems"] == [
        "no odometry",
        "the level LIDAR is silent",
        "the nodding LIDAR is silent",
    ]
    fly(bench, 1.5, begin_ns=S)
    assert last_status(statuses)["state"] == "mapping"
    fly(bench, 3.5, lambda t: scan(t, np.full(720, np.inf)), begin_ns=3 * S)
    assert last_status(statuses)["problems"] == [
        "the level LIDAR has no returns",
        "the nodding LIDAR has no returns",
    ]


def test_repeated_broken_and_orphaned_scans_are_counted():
    bench = NodeBench()
    mapping(bench)
    statuses = bench.listen("/uav1/mapping/status")
    one = room_scan(5 * MS)
    for message in (one, one, scan(210 * MS, np.ones(5), first=np.nan), room_scan(420 * MS)):
        bench.send("/uav1/laser/horizontal/scan", message)
    for k in range(12):  # without odometry of that time
        bench.send("/uav1/laser/horizontal/scan", room_scan(630 * MS + k * 210 * MS))
    bench.run_to(S)
    counts = last_status(statuses)["scans"]["level"]
    assert counts == {"dropped": 6, "repeated": 1, "unusable": 1}


def test_maps_are_saved_and_loaded_only_by_name(tmp_path):
    bench = NodeBench()
    node = mapping(bench, folder=str(tmp_path))
    fly(bench, 1.0)
    save = lambda name: bench.graph.call("/uav1/mapping/save", BY_NAME(name))  # noqa: E731
    assert save("room.bt").success
    assert (tmp_path / "room.bt").exists()
    for name in ("../room.bt", "/etc/room.bt", "room.txt", ""):
        answer = save(name)
        assert not answer.success
        assert "plain file name" in answer.message
    before = node._octree.binary()
    other = NodeBench()
    fresh = mapping(other, folder=str(tmp_path), map_file="room.bt")
    np.testing.assert_array_equal(fresh._octree.binary(), before)
    load = lambda bench, name: bench.graph.call("/uav1/mapping/load", BY_NAME(name))  # noqa: E731
    assert "cannot be read" in load(other, "none.bt").message
    fine = NodeBench()
    mapping(fine, folder=str(tmp_path), resolution_m=0.1)
    answer = load(fine, "room.bt")
    assert not answer.success
    assert "0.2 m wide; this node works with 0.1 m" in answer.message
    nowhere = NodeBench()
    mapping(nowhere, folder="")
    assert "folder is empty" in nowhere.graph.call("/uav1/mapping/save", BY_NAME("room.bt")).message


def test_maps_have_a_folder_of_their_own_from_the_start(tmp_path, monkeypatch):
    """Below the working folder, made with the first map; it does not grow without end."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("volery.autonomy.mapping.mapping_node._MAX_FILES", 2)
    bench = NodeBench()
    node = mapping(bench)
    fly(bench, 1.0)
    assert list(tmp_path.iterdir()) == []
    save = lambda name: bench.graph.call("/uav1/mapping/save", BY_NAME(name))  # noqa: E731
    answer = save("room.bt")
    written = int(answer.message.split()[0])
    assert (tmp_path / "maps/uav1/room.bt").exists()
    assert f"({node._octree.nodes} in memory" in answer.message
    assert save("other.bt").success
    assert save("room.bt").success  # anew
    assert "holds 2 maps already" in save("third.bt").message
    read = bench.graph.call("/uav1/mapping/load", BY_NAME("room.bt")).message
    assert read.startswith(f"{written} nodes read from maps/uav1/room.bt")


def test_the_drift_correction_of_tf_places_the_map():
    bench = NodeBench()
    bench.start(Mapping, odometry="odom", voxels_period_s=1.0)
    voxels = bench.listen("/uav1/octomap_binary")
    shift = Transform(Vector3(10.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    broken = Transform(Vector3(np.nan, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    tf = lambda child, t: TransformStamped(header(0, "map"), child, t)  # noqa: E731
    bench.send(
        "/tf",
        TFMessage([tf("uav1/odom", shift), tf("uav2/odom", broken), tf("uav1/odom", broken)]),
    )
    fly(bench, 1.2)
    cubes = decode_binary(np.asarray(voxels[-1].data).view(np.uint8))
    middles = cubes.corner[cubes.occupied, 0] * 0.2
    assert middles.min() > 5.5
    assert middles.max() < 14.5


def test_a_snapshot_goes_on_alike():
    bench, other = NodeBench(), NodeBench()
    node = mapping(bench)
    fly(bench, 0.6)
    twin = mapping(other)
    twin.set_state(copy.deepcopy(node.get_state()))
    other.run_to(bench.now_ns)
    before = node._octree.nodes
    step_aside = lambda time_ns: room_scan(time_ns, (1.0, 0.5))  # noqa: E731
    fly(bench, 0.6, step_aside, begin_ns=S)
    fly(other, 0.6, step_aside, begin_ns=S)
    assert node._octree.nodes > before
    np.testing.assert_array_equal(node._octree.binary(), twin._octree.binary())
    np.testing.assert_array_equal(node._grid.score, twin._grid.score)


def test_maps_of_two_are_merged_where_tf_places_them():
    bench = NodeBench()
    bench.start(MapMerging, topics=["/uav1/octomap_binary", "/uav2/octomap_binary"])
    single = NodeBench()
    node = mapping(single)
    fly(single, 0.6)
    data = node._octree.binary()
    merged, statuses = (
        bench.listen("/uav1/map_merging/octomap_binary"),
        bench.listen("/uav1/map_merging/status"),
    )
    bench.send("/uav1/octomap_binary", octomap_message(data.copy(), 0.2, "map", 0))
    bench.send("/uav2/octomap_binary", octomap_message(data.copy(), 0.2, "uav2/odom", 0))
    merge = lambda: bench.graph.call("/uav1/map_merging/merge", TRIGGER())  # noqa: E731
    assert merge().success
    bench.graph.deliver()
    np.testing.assert_array_equal(np.asarray(merged[-1].data).view(np.uint8), data)
    assert "/tf holds no transform" in last_status(statuses)["left_out"]["/uav2/octomap_binary"]
    shift = Transform(Vector3(20.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    bench.send("/tf", TFMessage([TransformStamped(header(0, "map"), "uav2/odom", shift)]))
    assert merge().success
    bench.graph.deliver()
    assert last_status(statuses) == {"merged": 2, "reason": "", "left_out": {}}
    cubes = decode_binary(np.asarray(merged[-1].data).view(np.uint8))
    x = cubes.corner[cubes.occupied, 0] * 0.2
    assert x.min() < -3.5
    assert x.max() > 23.5
    bench.send("/uav2/octomap_binary", octomap_message(data.copy(), 0.1, "map", 0))
    merge()
    bench.graph.deliver()
    assert "cells of 0.1 m" in last_status(statuses)["left_out"]["/uav2/octomap_binary"]


def test_parameters_that_are_misspelt_are_refused():
    with pytest.raises((GraphError, NodeError)):
        mapping(NodeBench(), folder=3)
