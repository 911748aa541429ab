"""The planning nodes on messages alone: what they answer to good and to bad ones."""

import copy
import json
import math

import numpy as np
import pytest
from node_bench import NodeBench, nod, odometry, scan

from volery.autonomy.mapping.merging import PlacedMap, merged
from volery.autonomy.mapping.messages import grid_values_message, octomap_message
from volery.autonomy.mapping.octomap_stream import Voxels
from volery.autonomy.perception.map_frame import MapFrame
from volery.autonomy.planning.exploration_node import POLYGON, Exploration
from volery.autonomy.planning.global_planner import GlobalPlanner
from volery.autonomy.planning.local_planner import PUSHED, TOO_DISTURBED, LocalPlanner
from volery.autonomy.planning.neighbours import Neighbours
from volery.autonomy.planning.primitives import PrimitivePath, PrimitiveState
from volery.autonomy.planning.tracking_error import TrackingError
from volery.autonomy.planning.trajectory_follower import TrajectoryFollower
from volery.autonomy.planning.trajectory_messages import samples_of, trajectory_message
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    PathMessage,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Range,
    Vector3,
    header,
    message_type,
)

S = 1_000_000_000
MS = 1_000_000
LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)
TRIGGER = message_type("std_srvs/srv/Trigger_Request")
HEIGHT = 3.0


def last_status(messages):
    return json.loads(messages[-1].data)


def pose(x, y, z=HEIGHT, frame="map"):
    return PoseStamped(header(0, frame), Pose(Point(x, y, z), LEVEL))


def path(*positions, frame="map"):
    return PathMessage(header(0, frame), [pose(*position) for position in positions])


# --------------------------------------------------------------------------------- local planner


class Glade:
    """A bench with a local planner that hovers on open ground at 3 m, walls 12 m around."""

    def __init__(self, **parameters):
        self.bench = NodeBench()
        self.node = self.bench.start(LocalPlanner, odometry="odom", use_map_tf=False, **parameters)
        self.plans = self.bench.listen("/uav1/planning/trajectory")
        self.status = self.bench.listen("/uav1/planning/status")
        self.now = 0
        self.ranges = np.full(720, 12.0)

    def go_on(self, seconds, odom=True, level=True, blind=False, stuck=False, height=HEIGHT):
        for _ in range(round(seconds / 0.02)):
            self.now += 20 * MS
            self.bench.run_to(self.now)
            if odom:
                self.bench.send("/uav1/odom", odometry(self.now, (0.0, 0.0, height)))
            tilt = 0.7 * math.sin(self.now * 1e-9 * 2.0 * math.pi)
            self.bench.send("/uav1/joint_states", nod(self.now, tilt))
            if (self.now // (20 * MS)) % 5:
                continue
            distance = np.float32(height + 0.01 * (self.now // (100 * MS) % 2))
            r = Range(header(self.now, ""), 0, 0.4, 0.2, 7.0, distance, 0.0)
            self.bench.send("/uav1/range", r)
            ranges = np.full(720, np.inf) if blind else self.ranges
            if not stuck:
                ranges = ranges + 1e-3 * math.sin(self.now * 1e-9)  # no two scans are alike
            if level:
                self.bench.send("/uav1/laser/horizontal/scan", scan(self.now, ranges))
            down = height / max(math.sin(tilt), 1e-9) if tilt > 0.0 else 12.0
            low = np.full(720, np.inf) if blind else np.minimum(12.0, np.full(720, down))
            self.bench.send("/uav1/laser/nodding/scan", scan(self.now, low, -1.5, 1.5))


def test_it_plans_towards_the_path_several_times_a_second():
    glade = Glade(speed_m_s=1.0)
    glade.go_on(1.0)
    assert last_status(glade.status)["state"] == "waiting"
    assert glade.plans == []
    glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
    glade.go_on(2.0)
    assert 10 <= len(glade.plans) <= 12  # every 0.18 s
    state = last_status(glade.status)
    assert state["state"] == "flying"
    assert state["problems"] == [PUSHED]  # the bench's UAV does not move
    samples = samples_of(glade.plans[-1])
    assert glade.plans[-1].header.frame_id == "uav1/odom"
    assert samples.position[-1, 0] > 0.2
    assert abs(samples.position[-1, 2] - HEIGHT) < 0.3
    np.testing.assert_allclose(samples.velocity[-1], 0.0, atol=1e-9)
    assert abs(samples.yaw) < 0.2
    glade.bench.send("/uav1/planning/path", path())
    glade.go_on(0.5)
    assert last_status(glade.status)["state"] == "holding"


def test_a_uav_that_is_pushed_off_its_plans_keeps_more_distance_at_less_speed():
    glade = Glade(safe_radius_m=0.6, speed_m_s=3.0)
    glade.go_on(1.0)
    calm = glade.node._policy()
    assert (calm.radius_m, calm.limits.speed) == (0.6, 3.0)
    glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
    glade.go_on(4.0)  # the bench's UAV does not move
    pushed = glade.node._policy()
    off_m = glade.node._tracking.largest_m
    assert last_status(glade.status)["off_m"] > 0.4
    assert pushed.radius_m == pytest.approx(min(0.6 + 1.5 * (off_m - 0.3), 1.5))
    assert pushed.soft_m - calm.soft_m == pytest.approx(pushed.radius_m - calm.radius_m)
    assert pushed.limits.speed < 2.9
    glade.go_on(1.0, odom=False)
    assert glade.node._tracking.largest_m <= off_m  # an old pose says nothing


def test_a_uav_that_is_pushed_too_far_holds_and_says_why():
    glade = Glade(speed_m_s=3.0)
    glade.go_on(1.0)
    glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
    for _ in range(20):  # the bench's UAV does not move
        glade.go_on(0.5)
        if last_status(glade.status)["state"] == "holding":
            break
    assert last_status(glade.status)["problems"] == [TOO_DISTURBED]
    samples = samples_of(glade.plans[-1])
    np.testing.assert_allclose(samples.velocity[-1], 0.0, atol=1e-9)
    held = len(glade.status)
    glade.go_on(40.0)  # at rest it is where it plans to be, until it plans to fly again
    assert "flying" in {json.loads(status.data)["state"] for status in glade.status[held:]}


def test_deviations_are_forgotten_in_calm_air():
    tracking = TrackingError()
    for k in range(100):
        tracking.add(0.25, k * S)
    assert tracking.margin_m == 0.0
    tracking.add(1.1, 100 * S)
    assert tracking.margin_m == pytest.approx(1.2)
    tracking.add(0.1, 130 * S)
    assert tracking.largest_m == pytest.approx(1.1 / math.e)
    for k in range(131, 200):
        tracking.add(0.1, k * S)
    assert tracking.margin_m == 0.0


def test_deviations_are_too_large_until_they_are_much_smaller():
    tracking = TrackingError()
    tracking.add(1.3, 1 * S)
    assert tracking.is_too_large
    for k in range(2, 12):
        tracking.add(0.1, k * S)
    assert tracking.is_too_large  # 1.3 m have faded to 0.9 m
    for k in range(12, 20):
        tracking.add(0.1, k * S)
    assert not tracking.is_too_large


def test_deviations_by_wrong_odometry_are_retracted():
    tracking = TrackingError()
    for k in range(40):
        tracking.add(0.4 if k < 20 else 2.0, k * S // 20)  # s 1 to 2 are wrong
    assert tracking.largest_m == 2.0
    assert tracking.is_too_large
    tracking.retract()
    assert not tracking.is_too_large
    assert 0.35 < tracking.largest_m < 0.4


@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        ({"odom": False}, "no odometry"),
        ({"level": False}, "the level LIDAR is silent"),
        ({"blind": True}, "no LIDAR has returns"),
        ({"stuck": True}, "the level LIDAR repeats itself"),
    ],
)
def test_without_its_senses_it_stops_and_says_why(fault, problem):
    glade = Glade()
    glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
    glade.go_on(1.5)
    glade.go_on(1.5, **fault)
    state = last_status(glade.status)
    assert state["state"] == "holding"
    assert problem in state["problems"]
    samples = samples_of(glade.plans[-1])
    assert np.hypot(*(samples.position[-1, :2] - samples.position[0, :2])) < 2.5
    glade.go_on(1.5)  # it comes back
    assert last_status(glade.status)["state"] == "flying"


def test_on_the_ground_nothing_is_planned():
    glade = Glade()
    glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
    glade.go_on(1.0, height=0.3)
    assert glade.plans == []
    assert "too low above ground to plan" in last_status(glade.status)["problems"]


@pytest.mark.parametrize("bad", [path((math.nan, 0.0)), path((1.0, 0.0), frame="uav2/odom")])
def test_a_path_that_is_none_is_refused(bad):
    glade = Glade()
    glade.bench.send("/uav1/planning/path", bad)
    assert last_status(glade.status)["state"] == "refused"
    glade.go_on(0.6)
    assert glade.plans == []


def test_a_path_in_the_map_with_a_slash_is_flown():
    glade = Glade()
    glade.bench.send("/uav1/planning/path", path((8.0, 0.0), frame="/map"))
    glade.go_on(0.6)
    assert glade.plans


def report(name, time_ns, position, velocity=(0.0, 0.0, 0.0)):
    """Returns the report of a teammate over the radio."""
    message = zero_message("volery_interfaces/msg/TeamReport")
    message.header, message.name = header(time_ns, "map"), name
    message.position, message.velocity = Point(*position), Vector3(*velocity)
    return message


def test_it_gives_way_to_a_teammate_that_comes_towards_it():
    ends = []
    for coming in (False, True):
        glade = Glade()
        glade.go_on(1.0)
        glade.bench.send("/uav1/planning/path", path((0.0, 0.0), (9.0, 0.0)))
        for _ in range(5):
            if coming:
                said = report("uav2", glade.now, (5.0, 0.2, HEIGHT), (-2.0, 0.0, 0.0))
                glade.bench.send("/uav1/radio/team", said)
            glade.go_on(0.2)
        ends.append(samples_of(glade.plans[-1]).position[-1])
    alone, beside = ends
    assert alone[0] > 2.0
    assert abs(alone[1]) < 1.0
    assert beside[0] < alone[0] - 0.5 or beside[1] < -1.0


def test_reports_that_are_late_repeated_or_no_numbers_move_no_teammate():
    near, frame = Neighbours(), MapFrame()
    near.on_report(report("uav2", 5 * S, (5.0, 0.0, HEIGHT), (1.0, 0.0, 0.0)), 6 * S)
    near.on_report(report("uav2", 4 * S, (9.0, 0.0, HEIGHT)), 7 * S)
    near.on_report(report("uav2", 5 * S, (9.0, 0.0, HEIGHT)), 7 * S)
    near.on_report(report("uav2", 7 * S, (math.nan, 0.0, HEIGHT)), 7 * S)
    near.on_report(report("uav3", 7 * S, (0.0, 0.0, HEIGHT), (math.inf, 0.0, 0.0)), 7 * S)
    (other,) = near.in_odom(frame)
    assert other.position.tolist() == [5.0, 0.0, HEIGHT]
    assert other.time_ns == 6 * S  # by the receiver's clock
    near.on_report(report("uav2", S, (2.0, 0.0, HEIGHT)), 30 * S)  # its clock began anew
    assert near.in_odom(frame)[0].position.tolist() == [2.0, 0.0, HEIGHT]


# --------------------------------------------------------------------------------------- follower


def plan_message(begins_ns, velocity=(1.0, 0.0, 0.0), frame="uav1/odom"):
    start = PrimitiveState(np.array([0.0, 0.0, HEIGHT]), np.array(velocity), np.zeros(3))
    return trajectory_message(
        PrimitivePath(start, np.array(velocity), 0.5, 1.0, 1.0), 0.3, frame, begins_ns
    )


def follower():
    bench = NodeBench()
    bench.start(TrajectoryFollower, odometry="odom")
    return bench, bench.listen("/uav1/cmd_vel"), bench.listen("/uav1/follower/status")


def test_samples_are_the_plan():
    start = PrimitiveState(np.zeros(3), np.array([1.0, 0.5, 0.0]), np.zeros(3))
    plan = PrimitivePath(start, np.array([2.0, 0.0, 0.3]), 0.9, 0.6, 1.3)
    samples = samples_of(trajectory_message(plan, -2.5, "uav1/odom", S))
    assert samples.yaw == pytest.approx(-2.5)
    for t in np.linspace(0.0, 4.0, 41):
        position, velocity = samples.at(S + round(t * S))
        np.testing.assert_allclose(position, plan.at(t).position, atol=0.02)
        np.testing.assert_allclose(velocity, plan.at(t).velocity, atol=0.05)
    np.testing.assert_allclose(samples.at(S // 2)[0], [-0.5, -0.25, 0.0])


def test_it_flies_the_plan_from_its_begin_and_rests_at_its_end():
    bench, commands, status = follower()
    bench.send("/uav1/odom", odometry(0, (0.0, -0.5, HEIGHT), yaw=math.pi / 2))
    bench.send("/uav1/planning/trajectory", plan_message(100 * MS))
    bench.run_to(90 * MS)
    assert commands == []
    bench.run_to(160 * MS)
    # The nose is to the north: the plan's east is to its right. It lies half a metre aside.
    assert commands[-1].linear.y == pytest.approx(-1.0, abs=0.2)
    assert commands[-1].linear.x == pytest.approx(2.0 * 0.5, abs=0.05)
    assert commands[-1].angular.z == pytest.approx(-1.2)
    assert last_status(status)["state"] == "flying"
    bench.send("/uav1/odom", odometry(3000 * MS, (2.0, 0.0, HEIGHT)))
    bench.run_to(3040 * MS)
    assert math.hypot(commands[-1].linear.x, commands[-1].linear.y) < 0.2


def test_it_stops_without_odometry_and_far_from_the_plan():
    bench, commands, status = follower()
    bench.send("/uav1/odom", odometry(0, (0.0, 0.0, HEIGHT)))
    bench.send("/uav1/planning/trajectory", plan_message(0))
    bench.run_to(400 * MS)
    assert commands[-1].linear.x > 0.5
    bench.run_to(700 * MS)
    assert last_status(status) == {"state": "stopped", "reason": "no odometry"}
    assert commands[-1].linear.x == commands[-1].angular.z == 0.0
    bench.send("/uav1/odom", odometry(700 * MS, (9.0, 9.0, HEIGHT)))
    bench.run_to(760 * MS)
    assert last_status(status)["reason"] == "too far from the plan"
    assert commands[-1].linear.x == 0.0


def test_plans_that_are_none_are_refused():
    bench, commands, status = follower()
    bench.send("/uav1/odom", odometry(0, (0.0, 0.0, HEIGHT)))
    bench.send("/uav1/planning/trajectory", plan_message(0, frame="uav2/odom"))
    assert last_status(status)["state"] == "refused"
    bench.send("/uav1/planning/trajectory", plan_message(0, velocity=(math.nan, 0.0, 0.0)))
    assert "not finite" in last_status(status)["reason"]
    bench.run_to(S)
    assert commands == []


def test_a_plan_in_the_frame_with_a_slash_is_flown():
    bench, commands, _ = follower()
    bench.send("/uav1/odom", odometry(0, (0.0, 0.0, HEIGHT)))
    bench.send("/uav1/planning/trajectory", plan_message(0, frame="/uav1/odom"))
    bench.run_to(S)
    assert commands


# --------------------------------------------------------------------------------- global planner


def ground_map(*blocks):
    """A map of level ground at z = 0, with blocks ((x0, y0), (x1, y1)) of 6 m height, m."""
    cells = {(x, y, 0) for x in range(-100, 101) for y in range(-60, 61)}
    for (x0, y0), (x1, y1) in blocks:
        box = [range(round(5 * a), round(5 * b)) for a, b in ((x0, x1), (y0, y1), (0.0, 6.0))]
        cells |= {(x, y, z) for x in box[0] for y in box[1] for z in box[2]}
    corner = np.array(sorted(cells), np.int32)
    voxels = Voxels(corner, np.ones(len(corner), np.int32), np.ones(len(corner), bool))
    return octomap_message(merged([PlacedMap(voxels)], 0.2, 10**7), 0.2, "map", 0)


def global_planner():
    bench = NodeBench()
    bench.start(GlobalPlanner, odometry="odom", use_map_tf=False)
    bench.send("/uav1/odom", odometry(0, (-8.0, 0.0, HEIGHT)))
    return bench, bench.listen("/uav1/planning/path"), bench.listen("/uav1/planning/goal_status")


def test_without_a_map_the_path_is_straight_and_with_one_it_leads_around():
    bench, paths, status = global_planner()
    bench.send("/uav1/planning/goal", pose(8.0, 0.0))
    assert len(paths[-1].poses) == 2
    assert last_status(status)["state"] == "planned"
    bench.send("/uav1/octomap_binary", ground_map(((-0.2, -8.0), (0.2, 3.0))))
    assert len(paths) == 2  # the map showed that the path was blocked
    assert len(paths[-1].poses) > 2
    assert max(p.pose.position.y for p in paths[-1].poses) > 3.0
    count = len(paths)
    bench.send("/uav1/octomap_binary", ground_map(((-0.2, -8.0), (0.2, 3.0))))
    assert len(paths) == count  # still clear
    bench.graph.call("/uav1/global_planner/stop", TRIGGER())
    bench.graph.deliver()
    assert len(paths[-1].poses) == 0


def test_goals_that_cannot_be_are_refused_and_the_uav_stays():
    bench, paths, status = global_planner()
    for goal, reason in (
        (pose(math.nan, 0.0), "not finite"),
        (pose(1.0, 0.0, frame="base_link"), "goals are in 'map'"),
        (pose(9000.0, 9000.0), "too far apart"),
        (pose(8.0, 0.0), "blocked"),
    ):
        bench.send("/uav1/octomap_binary", ground_map(((3.0, -6.0), (14.0, 6.0))))
        bench.send("/uav1/planning/goal", goal)
        assert last_status(status)["state"] == "refused"
        assert reason in last_status(status)["reason"]
        assert len(paths[-1].poses) == 0


def test_a_goal_that_is_never_reached_is_given_up():
    bench, paths, status = global_planner()
    bench.send("/uav1/planning/goal", pose(8.0, 0.0))
    for k in range(60):
        bench.run_to(k * S)
        bench.send("/uav1/odom", odometry(k * S, (-8.0, 0.0, HEIGHT)))
    assert last_status(status)["state"] == "unreachable"
    assert len(paths[-1].poses) == 0
    assert 3 <= last_status(status)["plans"] <= 5


# -------------------------------------------------------------------------------------- exploring


def polygon(*corners, frame="map"):
    shape = message_type("geometry_msgs/msg/Polygon")
    point = message_type("geometry_msgs/msg/Point32")
    return POLYGON(header(0, frame), shape([point(float(x), float(y), 0.0) for x, y in corners]))


def exploring():
    bench = NodeBench()
    bench.start(Exploration, odometry="odom", use_map_tf=False, view_radius_m=8.0)
    goals, status = bench.listen("/uav1/planning/goal"), bench.listen("/uav1/exploration/status")
    grid = grid_values_message(np.zeros((100, 150), np.int8), 0.4, (-5.0, -5.0, 0.0), "map", 0)
    bench.send("/uav1/projected_map", grid)
    bench.send("/uav1/odom", odometry(0, (1.0, 1.0, HEIGHT)))
    return bench, goals, status


def test_it_searches_until_all_is_seen():
    bench, goals, status = exploring()
    searched = bench.listen("/uav1/exploration/searched")
    bench.send("/uav1/search_area", polygon((0, 0), (40, 0), (40, 25), (0, 25)))
    position, now = np.array([1.0, 1.0]), 0
    for _ in range(400):
        now += 250 * MS
        if goals:
            goal = np.array([goals[-1].pose.position.x, goals[-1].pose.position.y])
            offset = goal - position
            distance = np.hypot(*offset)
            position = position + offset / max(distance, 1e-9) * min(0.75, distance)
        bench.run_to(now)
        bench.send("/uav1/odom", odometry(now, (*position, HEIGHT)))
        if status and last_status(status)["state"] == "done":
            break
    state = last_status(status)
    assert state["state"] == "done"
    assert state["covered"] > 0.97
    assert state["area_m2"] == 1000.0
    assert state["searched_m2"] == pytest.approx(1000.0 * state["covered"], rel=0.01)
    assert (np.asarray(searched[-1].data) == 100).mean() > 0.5


def test_an_area_in_the_map_with_a_slash_is_searched():
    bench, goals, status = exploring()
    bench.send("/uav1/search_area", polygon((0, 0), (40, 0), (40, 25), frame="/map"))
    bench.run_to(S)
    assert last_status(status)["state"] != "waiting"
    assert goals


def test_areas_that_are_none_are_refused():
    bench, goals, status = exploring()
    for area, reason in (
        (polygon((0, 0), (1, 0)), "three corners"),
        (polygon((0, 0), (math.nan, 0), (1, 1)), "finite"),
        (polygon((0, 0), (40, 0), (0, 40), frame="odom"), "areas are in 'map'"),
        (polygon((0, 0), (1e5, 0), (0, 1e5)), "cells"),
        (polygon(), "no area"),
    ):
        bench.send("/uav1/search_area", area)
        bench.run_to(bench.now_ns + S)
        assert last_status(status)["state"] == "waiting"
        assert reason in last_status(status)["reason"]
    assert goals == []


def test_a_uav_that_gets_nowhere_is_blocked_in_the_end():
    bench, _, status = exploring()
    bench.send("/uav1/search_area", polygon((0, 0), (14, 0), (14, 14), (0, 14)))
    for k in range(200):
        bench.run_to(k * S)
        bench.send("/uav1/odom", odometry(k * S, (1.0, 1.0, HEIGHT)))
        if status and last_status(status)["state"] == "blocked":
            break
    state = last_status(status)
    assert state["state"] == "blocked"
    assert state["given_up"] >= 1
    assert "cannot be reached" in state["reason"]


@pytest.mark.parametrize(
    "node_class", [LocalPlanner, GlobalPlanner, Exploration, TrajectoryFollower]
)
def test_states_go_back(node_class):
    """A twin that takes over a state publishes from then on what the first one publishes."""
    published = []
    first, second = NodeBench(), NodeBench()
    node, twin = (bench.start(node_class, odometry="odom") for bench in (first, second))
    grid = grid_values_message(np.zeros((50, 50), np.int8), 0.4, (-5.0, -5.0, 0.0), "map", 0)
    for topic, message in (
        ("odom", odometry(5 * MS, (1.0, 2.0, HEIGHT))),
        ("search_area", polygon((0, 0), (9, 0), (0, 9))),
        ("projected_map", grid),
        ("planning/goal", pose(8.0, 0.0)),
        ("planning/path", path((0.0, 0.0), (9.0, 0.0))),
        ("planning/trajectory", plan_message(5 * MS)),
        ("range", Range(header(0, ""), 0, 0.4, 0.2, 7.0, np.float32(HEIGHT), 0.0)),
    ):
        first.send(f"/uav1/{topic}", message)
    twin.set_state(copy.deepcopy(node.get_state()))
    for bench in (first, second):
        received = []
        bench.graph.subscribe_all(lambda p, received=received: received.append((p.topic, p.cdr)))
        bench.graph.deliver()
        received.clear()  # what was latched before
        for k in range(1, 80):
            bench.run_to(k * 100 * MS)
            bench.send("/uav1/odom", odometry(bench.now_ns, (1.0 + 0.01 * k, 2.0, HEIGHT)))
        published.append([each for each in received if each[0] != "/uav1/odom"])
    assert published[0] == published[1]
    assert len(published[0]) > 1
