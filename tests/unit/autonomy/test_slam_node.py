"""The SLAM node on sensor messages alone, good and bad ones."""

import copy
import dataclasses
import json

import numpy as np
import pytest
from node_bench import NodeBench
from slam_bench import (
    GRAVITY,
    LEVEL,
    MS,
    NODDING,
    Flight,
    S,
    imu_message,
    messages,
    trunks,
    yaw_of,
)  # fmt: skip

from volery.autonomy.slam.health import SlamHealth
from volery.autonomy.slam.match import Match
from volery.autonomy.slam.slam_node import Slam
from volery.core.errors import NodeError

WOODS = trunks()
MOUNTS = {"level_mount": LEVEL.tolist(), "nodding_mount": NODDING.tolist()}
START = [100.0, -50.0, 7.0, 0.5]
SECONDS = 9.0


@pytest.fixture(scope="module")
def flown():
    """Nine seconds with biases of 1.5 deg/s and 0.1 m/s^2."""
    return messages(Flight(), WOODS, SECONDS, biases=(0.0087, 0.1))


class Listening:
    """A SLAM node and the messages that it publishes."""

    def __init__(self, **parameters):
        self.bench = NodeBench()
        settings = {"initial_pose": START, **MOUNTS, **parameters}
        self.node = self.bench.start(Slam, **settings)
        self.odom, self.pose, self.tf, self.path, self.status = (
            self.bench.listen(topic)
            for topic in (
                "/uav1/slam/odom",
                "/uav1/slam/pose",
                "/tf",
                "/uav1/slam/path",
                "/uav1/slam/status",
            )
        )

    def receive(self, rows):
        for when, topic, message in rows:
            self.bench.run_to(max(when, self.bench.now_ns))
            self.bench.send(f"/uav1/{topic}", message)
        self.bench.run_to(self.bench.now_ns + 600 * MS)
        return self

    def last_status(self):
        return json.loads(self.status[-1].data)

    def state(self):
        return self.last_status()["state"]


def truth_in_map(time_ns):
    position, yaw = Flight().pose(time_ns / S)
    c, s = np.cos(START[3]), np.sin(START[3])
    turned = np.array([c * position[0] - s * position[1], s * position[0] + c * position[1], 0.0])
    return np.array(START[:3]) + turned + [0.0, 0.0, position[2] - 0.2], yaw + START[3]


def errors(poses):
    off, turned = [], []
    for message in poses:
        stamp = message.header.stamp
        position, yaw = truth_in_map(stamp.sec * S + stamp.nanosec)
        p = message.pose.pose.position
        off.append(np.array([p.x, p.y, p.z]) - position)
        turned.append(yaw_of(message.pose.pose.orientation) - yaw)
    return np.array(off), np.remainder(np.array(turned) + np.pi, 2.0 * np.pi) - np.pi


@pytest.fixture(scope="module")
def slam(flown):
    return Listening().receive(flown)


def test_it_follows_a_flight_from_the_ground_on(slam):
    off, turned = errors(slam.pose)
    assert len(off) > 70
    assert np.abs(off).max() < 0.2
    assert np.abs(turned).max() < 0.02
    assert slam.state() == "tracking"
    assert slam.last_status()["refused"] == 0


def test_odometry_is_smooth_and_frequent_and_says_how_fast_it_flies(slam):
    stamps = np.array([m.header.stamp.sec * S + m.header.stamp.nanosec for m in slam.odom])
    assert set(np.diff(stamps)) == {20 * MS}
    positions = np.array([[getattr(m.pose.pose.position, k) for k in "xyz"] for m in slam.odom])
    assert np.abs(np.diff(positions, axis=0)).max() < 0.06  # 2 m/s and a centimetre or two
    last = slam.odom[-1]
    assert last.header.frame_id == "uav1/odom"
    assert last.child_frame_id == "uav1/base_link"
    assert last.twist.twist.linear.x == pytest.approx(2.0, abs=0.1)
    assert last.twist.twist.angular.z == pytest.approx(2.0 / 15.0, abs=0.05)
    variances = last.pose.covariance.reshape(6, 6).diagonal()
    assert (variances > 0.0).all()


def test_frames_are_tied_together_and_the_path_is_published(slam):
    moved = slam.tf[-1].transforms[0]
    assert (moved.header.frame_id, moved.child_frame_id) == ("map", "uav1/odom")
    assert slam.path[-1].header.frame_id == "map"
    first = slam.path[-1].poses[0].pose.position
    assert [first.x, first.y, first.z] == pytest.approx(START[:3], abs=0.05)
    assert len(slam.path[-1].poses) >= 5


def test_without_a_start_the_map_begins_where_it_begins(flown):
    first = Listening(initial_pose=[]).receive(flown[: len(flown) // 4]).pose[0].pose.pose
    position = [first.position.x, first.position.y, first.position.z]
    assert position == pytest.approx([0.0] * 3, abs=0.05)


def test_the_same_messages_give_the_same_bytes_and_a_kept_state_goes_on(flown):
    whole = Listening().receive(flown)
    half = len(flown) // 2
    one = Listening()
    for when, topic, message in flown[:half]:
        one.bench.run_to(max(when, one.bench.now_ns))
        one.bench.send(f"/uav1/{topic}", message)
    kept = copy.deepcopy(one.node.get_state())
    before = len(one.odom)
    one.receive(flown[half:])
    assert [repr(m) for m in one.odom] == [repr(m) for m in whole.odom]
    again = one.odom[before:]
    one.node.set_state(kept)
    one.odom.clear()
    for when, topic, message in flown[half:]:
        one.bench.now_ns = when
        one.bench.send(f"/uav1/{topic}", message)
    assert [repr(m) for m in one.odom] == [repr(m) for m in again]


def test_repeated_late_and_lost_messages_are_counted_and_change_little(flown):
    spoilt = []
    for k, row in enumerate(flown):
        if k % 17 == 5 and row[1] != "imu":
            continue
        spoilt.append(row)
        if k % 13 == 0:
            spoilt.append(row)
        if k % 29 == 0 and k > 50:
            spoilt.append((row[0], *flown[k - 50][1:]))
    slam = Listening().receive(spoilt)
    off, _ = errors(slam.pose)
    assert np.abs(off).max() < 0.25
    assert slam.last_status()["refused"] > 100
    assert slam.state() == "tracking"


def test_samples_that_are_no_numbers_are_left_out(flown):
    spoilt = []
    for k, (when, topic, message) in enumerate(flown):
        row = message
        if topic == "imu" and k % 40 == 0:
            row = copy.deepcopy(message)
            row.angular_velocity.x = float("nan")
        if topic.startswith("laser") and k % 3 == 0:
            ranges = message.ranges.copy()
            ranges[::2] = np.nan
            row = dataclasses.replace(message, ranges=ranges)
        spoilt.append((when, topic, row))
    slam = Listening().receive(spoilt)
    off, _ = errors(slam.pose)
    assert np.isfinite(off).all()
    assert np.abs(off).max() < 0.25
    assert slam.last_status()["refused"] > 10


def without(flown, wanted, since_ns):
    return [row for row in flown if row[0] < since_ns or wanted(row[1])]


def test_blinded_lidars_are_reported(flown):
    blind = []
    for when, topic, message in flown:
        row = message
        if topic.startswith("laser") and when > 6 * S:
            row = dataclasses.replace(message, ranges=np.full(1081, np.inf, np.float32))
        blind.append((when, topic, row))
    slam = Listening().receive(blind)
    assert slam.state() in ("degraded", "lost")
    assert "the level LIDAR is silent" in slam.last_status()["problems"]
    sigma = slam.odom[-1].pose.covariance[0] ** 0.5
    off, _ = errors(slam.pose)
    assert np.abs(off[-1][:2]).max() < 4.0 * sigma + 0.2


def test_a_silent_imu_is_reported(flown):
    slam = Listening().receive(without(flown, lambda topic: topic != "imu", 6 * S))
    assert "the IMU is silent" in slam.last_status()["problems"]
    assert slam.state() != "tracking"


@pytest.mark.parametrize("gap_s", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("everything", [False, True])
def test_after_a_gap_in_the_imu_it_finds_its_position_and_speed_again(flown, gap_s, everything):
    """On an arc at 2 m/s; the LIDARs go on meanwhile, or nothing is received at all."""
    begin, end = 6 * S, round((6 + gap_s) * S)
    left = [row for row in flown
            if not begin <= row[0] < end or not (everything or row[1] == "imu")]  # fmt: skip
    slam = Listening().receive(left)
    off, turned = errors(m for m in slam.pose if stamp_ns(m) > end + S)
    assert len(off) > 10
    assert np.abs(off).max() < 0.3
    assert np.abs(turned).max() < 0.05
    speeds = [np.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y) for m in slam.odom
              if stamp_ns(m) > end + S]  # fmt: skip
    assert np.abs(np.array(speeds) - 2.0).max() < 0.3
    assert slam.last_status()["sessions"] == 1
    assert slam.state() == "tracking"


def test_a_shock_does_not_leave_it_with_a_wrong_speed(flown):
    """A sample of 200 m/s^2 adds 1 m/s; the next sweeps correct it."""
    hit = [(when, topic, shaken(m) if topic == "imu" and when == 7 * S else m)
           for when, topic, m in flown]  # fmt: skip
    slam = Listening().receive(hit)
    speeds = [(m.twist.twist.linear.z, np.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y))
              for m in slam.odom if stamp_ns(m) > 7.2 * S]  # fmt: skip
    assert np.abs(np.array(speeds) - [0.0, 2.0]).max() < 0.2


def shaken(imu):
    force = imu.linear_acceleration
    return dataclasses.replace(
        imu, linear_acceleration=dataclasses.replace(force, x=100.0, z=200.0)
    )


def stamp_ns(message):
    return message.header.stamp.sec * S + message.header.stamp.nanosec


def test_a_gap_in_the_imu_is_reported_until_the_position_is_found(flown):
    """Nothing is seen for half a second after the gap."""
    blind = [(when, topic, unseeing(m) if "laser" in topic and when > 6 * S else m)
             for when, topic, m in flown if not (topic == "imu" and 6 * S <= when < 6.6 * S)
             and when < 7.1 * S]  # fmt: skip
    slam = Listening().receive(blind)
    assert slam.state() == "lost"
    assert "gap in the IMU data" in slam.last_status()["problems"]
    assert all(stamp_ns(m) <= 6 * S for m in slam.pose)
    slam.receive([row for row in flown if row[0] >= 7.1 * S])
    off, _ = errors(slam.pose[-5:])
    assert slam.state() == "tracking"
    assert np.abs(off).max() < 0.3


def unseeing(scan):
    return dataclasses.replace(scan, ranges=np.full_like(scan.ranges, np.inf))


def test_featureless_space_is_reported():
    flat = messages(Flight(), np.zeros((0, 3)), 7.0)
    slam = Listening().receive(flat)
    assert "too few returns in range" in slam.last_status()["problems"]
    assert slam.state() == "degraded"
    off, _ = errors(slam.pose)
    assert np.abs(off[:, 2]).max() < 0.1  # the ground still gives its height


def test_a_clock_that_is_set_makes_it_lost_until_it_relocalizes(flown):
    later = [(when, topic, shifted(message, 100 * S)) for when, topic, message in flown
             if when > 7 * S]  # fmt: skip
    before = [row for row in flown if row[0] <= 7 * S]
    slam = Listening().receive([*before, *later])
    assert slam.last_status()["clock_set"] == 1
    assert slam.last_status()["sessions"] == 2
    assert np.isfinite([slam.odom[-1].pose.pose.position.x]).all()


def shifted(message, by_ns):
    moved = copy.deepcopy(message)
    stamp = moved.header.stamp
    total = stamp.sec * S + stamp.nanosec + by_ns
    stamp.sec, stamp.nanosec = divmod(total, S)
    return moved


def test_a_kidnapped_uav_finds_itself_or_says_lost(flown):
    """After nine seconds it is suddenly where it had been five before, and flies on from there."""
    again = [(when + 5 * S, topic, shifted(message, 5 * S)) for when, topic, message in flown
             if when > 4 * S + 20 * MS]  # fmt: skip
    slam = Listening().receive([*flown, *again])
    states = [json.loads(m.data)["state"] for m in slam.status]
    assert "lost" in states
    last = slam.last_status()
    p = slam.pose[-1].pose.pose.position
    expected, _ = truth_in_map(slam.pose[-1].header.stamp.sec * S
                            + slam.pose[-1].header.stamp.nanosec - 5 * S)  # fmt: skip
    found = np.abs(np.array([p.x, p.y, p.z]) - expected).max() < 0.3
    assert found or last["state"] == "lost"
    assert last["closures"] >= 1


def test_new_maps_in_flight_leave_the_velocity_right(flown):
    slam = Listening().receive([row for row in flown if row[0] <= 7 * S])
    slam.node._lose(0.5, 0.0)
    since = slam.bench.now_ns
    slam.receive([row for row in flown if row[0] > 7 * S])
    speeds = [np.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y) for m in slam.odom
              if m.header.stamp.sec * S + m.header.stamp.nanosec > since]  # fmt: skip
    assert len(speeds) > 50
    assert np.abs(np.array(speeds) - 2.0).max() < 0.3
    assert slam.last_status()["sessions"] == 2


@pytest.mark.parametrize(("fraction", "lost"), [(0.3, False), (0.03, True)])
def test_much_that_is_new_is_no_loss_and_nothing_as_it_was_is_one(flown, fraction, lost):
    """0.6 of the returns are usually met; `fraction` of them for two seconds."""
    slam = Listening().receive([row for row in flown if row[0] <= 7 * S])
    tracker, health = slam.node._tracker, SlamHealth(("IMU",), slam.bench.now_ns)
    found = []
    for _ in range(5):
        tracker._imu = (tracker.time_ns + S // 2, *tracker._imu[1:])
        tracker.match = {
            name: Match(tracker.time_ns, 100.0 * fraction, 100.0, 50.0, 0.6)
            for name in tracker.match
        }
        found.append(health.look(tracker, slam.bench.now_ns, is_placed=True))
        assert tracker.match["level"].fits != lost
    assert any(found) == lost


def test_a_turn_while_it_settles_is_known(flown):
    """It stands crooked by 0.4 degrees to where it was put down; the gyroscope has a bias."""
    settling, turn_s = np.radians(0.4), 0.1
    before = []
    for k in range(round(200 * turn_s)):
        rate = np.array([0.0, 0.0, settling / turn_s]) + 0.0087
        force = np.array([0.1, 0.1, GRAVITY + 0.1 + 0.5 * np.sin(k)])
        before.append((k * 5 * MS, "imu", imu_message(k * 5 * MS, rate, force)))
    later = [(when + round(turn_s * S), topic, shifted(m, round(turn_s * S)))
             for when, topic, m in flown if when < 4 * S]  # fmt: skip
    slam = Listening().receive([*before, *later])
    yaw = yaw_of(slam.odom[-1].pose.pose.orientation)
    _, without = errors([Listening().receive([row for row in flown if row[0] < 4 * S]).odom[-1]])
    assert yaw - START[3] - settling == pytest.approx(without[0], abs=np.radians(0.08))


def test_wrong_parameters_are_refused():
    with pytest.raises(NodeError, match="initial_pose must be"):
        NodeBench().start(Slam, initial_pose=[1.0, 2.0])
