"""The planar SLAM on scans of rooms and corridors, good and bad ones."""

import copy
import json

import numpy as np
import pytest
from node_bench import NodeBench
from planar_bench import (
    ROUND,
    Carried,
    S,
    corridor,
    odometry_message,
    scan_message,
    storey,
)

from volery.autonomy.slam.planar_node import PlanarSlam
from volery.core.errors import NodeError
from volery.results.alignment import ate_rmse_m

TOPIC, MS = "/uav1/laser/horizontal/scan", S // 1000


class Listening:
    """A planar SLAM and what it says."""

    def __init__(self, **parameters):
        self.bench = NodeBench()
        self.node = self.bench.start(PlanarSlam, **parameters)
        self.pose, self.odom, self.path, self.status = (
            self.bench.listen(f"/uav1/slam/{word}") for word in ("pose", "odom", "path", "status")
        )

    def receive(self, scan, odometry=None, at_ns=None):
        stamp = scan.header.stamp.sec * S + scan.header.stamp.nanosec
        self.bench.run_to(max(stamp if at_ns is None else at_ns, self.bench.now_ns))
        if odometry is not None:
            self.bench.send("/uav1/odom", odometry)
        self.bench.send(TOPIC, scan)

    def carry(self, carried, rows=None, with_odometry=False):
        for row in range(len(carried.time_s)) if rows is None else rows:
            odometry = carried.odometry_message(row) if with_odometry else None
            self.receive(carried.scan(row), odometry)
        return self.settle()

    def settle(self, seconds=2.0):
        self.bench.run_to(self.bench.now_ns + round(seconds * S))
        return self

    def last(self):
        return json.loads(self.status[-1].data)

    def states(self):
        return {json.loads(one.data)["state"] for one in self.status}

    def poses(self):
        """(N, 4) time, x, y, yaw as they were published at the time."""
        return rows_of([(one.header, one.pose.pose) for one in self.pose])

    def keyframes(self):
        """The same of the keyframes, as they are known at the end."""
        return rows_of([(one.header, one.pose) for one in self.path[-1].poses])


def rows_of(stamped):
    return np.array([
        (h.stamp.sec + h.stamp.nanosec * 1e-9, p.position.x, p.position.y,
         2.0 * np.arctan2(p.orientation.z, p.orientation.w))
        for h, p in stamped
    ])  # fmt: skip


def ate(rows, carried):
    true = np.stack([np.interp(rows[:, 0], carried.time_s, c) for c in carried.poses.T], 1)
    flat = np.zeros((len(rows), 1))
    return ate_rmse_m(np.hstack([rows[:, 1:3], flat]), np.hstack([true[:, :2], flat]))


@pytest.fixture(scope="module")
def lap():
    """Around a storey and on: 128 m at 1 m/s, 5 scans a second."""
    return Carried(storey(), ROUND)


@pytest.fixture(scope="module")
def short(lap):
    """The first 40 s of it."""
    short = copy.copy(lap)
    for name in ("time_s", "poses", "ranges", "odometry"):
        setattr(short, name, getattr(lap, name)[:200])
    return short


@pytest.mark.parametrize("with_odometry", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_loop_of_a_hundred_metres_is_closed(lap, with_odometry):
    slam = Listening().carry(lap, with_odometry=with_odometry)
    assert ate(slam.keyframes(), lap) < 0.08
    assert slam.last()["closures"] >= 3
    assert slam.last()["sessions"] == 1
    assert slam.states() <= {"starting", "tracking", "degraded"}
    last = slam.poses()[-1]
    true = lap.poses[-1] - lap.poses[0]
    assert np.hypot(*(last[1:3] - true[:2])) < 0.25


@pytest.mark.slow
def test_without_closures_it_drifts_and_says_how_far_it_may_be_off(lap):
    slam = Listening(loop_closures=False).carry(lap)
    sigma = slam.last()["sigma_m"]
    off = np.hypot(*(slam.poses()[-1, 1:3] - lap.poses[-1, :2]))
    assert off < 4.0 * sigma
    assert 0.1 < sigma < 5.0
    assert slam.last()["closures"] == 0


def plain(seed=3, speed=1.0):
    return Carried(
        corridor(), [(0.0, 0.0), (40.0, 0.0)], max_range_m=8.0, seed=seed, speed=speed, beams=181,
        fov_deg=180.0,
    )  # fmt: skip


@pytest.mark.parametrize("seed", [3, 4])
def test_a_plain_corridor_does_not_hold_it_back(seed):
    """Nothing but two walls is seen for half a minute: it goes on as it went."""
    carried = plain(seed)
    slam = Listening().carry(carried, rows=range(0, 190))
    x = np.interp(35.0, *slam.poses()[:, :2].T)
    true = np.interp(35.0, carried.time_s, carried.poses[:, 0])
    assert true > 30.0
    assert 0.8 < x / true < 1.3
    assert np.abs(slam.poses()[:, 2]).max() < 0.5
    assert "scans leave one direction unconstrained" in slam.last()["problems"]
    own = np.sqrt(slam.odom[-1].pose.covariance.reshape(6, 6).diagonal())
    assert own[0] > 1.0 > 5.0 * own[1]
    sigma = np.sqrt(slam.pose[-1].pose.covariance.reshape(6, 6).diagonal())
    assert abs(slam.poses()[-1, 1] - carried.poses[189, 0]) < 3.0 * sigma[0]


def test_in_a_plain_corridor_odometry_gives_the_distance_along_it():
    carried = plain()
    slam = Listening().carry(carried, with_odometry=True)
    x, y = slam.poses()[-1, 1:3]
    assert x == pytest.approx(1.02 * carried.poses[-1, 0], rel=0.02)  # the wheels slip by that
    assert abs(y) < 0.1
    sigma = np.sqrt(slam.pose[-1].pose.covariance.reshape(6, 6).diagonal())
    assert abs(x - carried.poses[-1, 0]) < 4.0 * sigma[0]


def test_scans_may_be_missing(short):
    """Three in ten, and once a whole second."""
    rows = np.flatnonzero(np.random.default_rng(2).random(200) > 0.3)
    slam = Listening().carry(short, rows=rows[(rows < 100) | (rows > 105)], with_odometry=True)
    assert ate(slam.poses(), short) < 0.1
    slam = Listening().carry(short, rows=rows[(rows < 100) | (rows > 105)])
    assert ate(slam.poses(), short) < 0.2


def test_another_number_of_beams_is_another_scan(short):
    slam = Listening()
    for row in range(200):
        scan = short.scan(row)
        if 80 <= row < 120:
            scan = scan_message(round(short.time_s[row] * S), short.ranges[row][::2],
                                short.angles[::2], short.max_range_m)  # fmt: skip
        if row == 140:
            scan = scan_message(round(short.time_s[row] * S), [], short.angles, short.max_range_m)
        slam.receive(scan)
    assert ate(slam.settle().poses(), short) < 0.06
    assert slam.last()["refused"] == 1


def test_what_is_no_range_does_not_count(short):
    spoilt = copy.copy(short)
    spoilt.ranges = short.ranges.copy()
    random = np.random.default_rng(5)
    for value in (np.nan, 0.0, -np.inf, 65.533, 1e30):
        spoilt.ranges[random.random(spoilt.ranges.shape) < 0.08] = value
    assert ate(Listening().carry(spoilt).poses(), short) < 0.06


def test_a_clock_that_is_set_back_is_gone_along_with(short):
    slam = Listening()
    for row in range(200):
        scan, odometry = short.scan(row), short.odometry_message(row)
        if row >= 100:
            back = round((short.time_s[row] - 15.0) * S)
            scan = scan_message(back, short.ranges[row], short.angles, short.max_range_m)
            odometry = odometry_message(back, short.odometry[row])
        slam.receive(scan, odometry, at_ns=round(short.time_s[row] * S))
    poses = slam.settle().poses()
    assert slam.last()["clock_set"] == 1
    assert slam.last()["sessions"] == 1
    assert np.hypot(*(poses[-1, 1:3] - short.poses[199, :2])) < 0.3


def test_scans_that_come_twice_or_cannot_be_read_are_refused(short):
    slam = Listening()
    for row in range(50):
        slam.receive(short.scan(row))
        slam.receive(short.scan(row))
        broken = short.scan(row)
        broken.angle_min = float("nan")
        slam.receive(broken)
    assert slam.settle().last()["refused"] == 100
    assert ate(slam.poses(), short) < 0.05


def test_a_kidnapped_scanner_says_so_and_relocalizes():
    """From a room into the corridor; then it is carried back into the room unseen."""
    corners = [(3.0, 8.5), (9.0, 8.0), (8.5, 3.0), (6.5, 2.5), (6.5, 0.0), (14.0, 0.0)]
    carried = Carried(storey(), corners, max_range_m=8.0)
    slam = Listening().carry(carried)
    first = carried.poses[0]
    stamps = round(carried.time_s[-1] * S) + 3 * S
    for row in range(60):
        stamp = stamps + round(carried.time_s[row] * S)
        slam.receive(scan_message(stamp, carried.ranges[row], carried.angles, carried.max_range_m))
    slam.settle()
    assert slam.last()["sessions"] >= 2
    assert "lost" in slam.states()
    assert slam.last()["state"] in ("tracking", "degraded")
    c, s = np.cos(first[2]), np.sin(first[2])
    moved = carried.poses[59, :2] - first[:2]
    true = [c * moved[0] + s * moved[1], c * moved[1] - s * moved[0]]
    assert np.hypot(*(slam.poses()[-1, 1:3] - true)) < 0.3


def test_silence_and_emptiness_are_named(short):
    slam = Listening().carry(short, rows=range(30))
    blind = np.full(len(short.angles), np.inf)
    for row in range(30, 50):
        slam.receive(
            scan_message(round(short.time_s[row] * S), blind, short.angles, short.max_range_m)
        )
    slam.bench.run_to(slam.bench.now_ns + 700 * MS)
    assert "too few returns in range" in slam.last()["problems"]
    slam.settle(3.0)
    assert "the LIDAR is silent" in slam.last()["problems"]


def test_a_kept_state_goes_on_as_before(short):
    one, other = Listening(), Listening()
    one.carry(short, rows=range(100), with_odometry=True)
    other.node.set_state(copy.deepcopy(one.node.get_state()))
    published = []
    for slam in (one, other):
        slam.bench.run_to(one.bench.now_ns)
        first = len(slam.pose)
        for row in range(100, 160):
            slam.receive(short.scan(row), short.odometry_message(row))
        published.append([repr(message) for message in slam.pose[first:]])
    assert len(published[0]) == 60
    assert published[0] == published[1]


def test_parameters_of_the_wrong_length_are_refused():
    with pytest.raises(NodeError, match="initial_pose must be"):
        Listening(initial_pose=[1.0])
    with pytest.raises(NodeError, match="mount must be"):
        Listening(mount=[1.0])


def test_a_scanner_that_hangs_upside_down_and_aside_is_placed(short):
    """Its beams run clockwise, from a mount 0.2 m ahead, turned by 30 degrees."""
    carried = copy.copy(short)
    offset = np.array([0.2, -0.1])
    poses = short.poses[:60]
    from planar_bench import cast

    angles = np.radians(30.0) - short.angles  # roll of 180 degrees mirrors
    carried.ranges = np.array([
        cast(short.walls, [
            pose[0] + np.cos(pose[2]) * offset[0] - np.sin(pose[2]) * offset[1],
            pose[1] + np.sin(pose[2]) * offset[0] + np.cos(pose[2]) * offset[1], pose[2]], angles)
        for pose in poses
    ])  # fmt: skip
    mount = [*offset.tolist(), 0.3, np.pi, 0.0, np.radians(30.0)]
    slam = Listening(mount=mount).carry(carried, rows=range(60))
    assert ate(slam.poses(), short) < 0.03
