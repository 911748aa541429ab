"""Nodes that land stop first: a UAV that lands in flight comes down beyond its position."""

import itertools
import math

import numpy as np
import pytest
from node_bench import NodeBench, odometry

from volery.autonomy.avoidance.depth_course import DepthCourse, DepthCoursePhase
from volery.autonomy.avoidance.gap_following import GapFollowing
from volery.autonomy.avoidance.stop import Stop
from volery.autonomy.coverage.flight import CoverageFlight
from volery.autonomy.coverage.planner_node import CoveragePlanner
from volery.autonomy.coverage.waypoints import WaypointProgress
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.team.task_manager import TaskManager
from volery.autonomy.team.team_state import MissionPhase
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import CameraInfo, Image, Twist, Vector3, message_type

TICK_NS = 20_000_000
BRAKES_M_S2 = 2.0
STILL_M_S = 0.3


class Flier:
    """A point that follows `cmd_vel` with an acceleration, and notes where a command lands it."""

    def __init__(self, bench):
        self.bench = bench
        self.position, self.velocity = np.zeros(3), np.zeros(3)
        self.flies, self.landed_at, self.speed_at_landing = False, None, None
        self._commands = bench.listen("/uav1/cmd_vel")
        for name, act in (("take_off", self._take_off), ("land", self._land)):
            bench.graph.create_service(f"/uav1/{name}", "std_srvs/srv/Trigger", act)

    def _take_off(self, _request):
        self.flies = True
        return answer()

    def _land(self, _request):
        self.landed_at = self.position.copy()
        self.speed_at_landing = float(np.hypot(*self.velocity[:2]))
        return answer()

    def tick(self):
        step_s = TICK_NS * 1e-9
        wanted = np.array([0.0, 0.0, 1.0 if self.flies else 0.0])
        if self._commands:
            last = self._commands[-1].linear
            wanted = np.array([last.x, last.y, last.z])
        change = wanted - self.velocity
        max_change = BRAKES_M_S2 * step_s
        self.velocity += change * min(1.0, max_change / max(float(np.linalg.norm(change)), 1e-9))
        self.position += step_s * self.velocity
        now = self.bench.now_ns + TICK_NS
        self.bench.send("/uav1/odom", odometry(now, self.position, self.velocity))
        self.bench.run_to(now)

    def fly(self, seconds):
        for _ in range(round(seconds * 1e9) // TICK_NS):
            if self.landed_at is not None:
                return
            self.tick()


def answer():
    response = zero_message("std_srvs/srv/Trigger_Response")
    response.success = True
    return response


def sample(speed):
    return OdometrySample.from_odometry(odometry(0, (0.0, 0.0, 3.0), (speed, 0.0, 0.0)))


@pytest.fixture
def bench():
    return NodeBench()


def along_a_route(bench, **parameters):
    node = bench.start(GapFollowing, route=[[15.0, 0.0]], **parameters)
    return Flier(bench), node


def test_gap_following_stops_before_it_lands(bench):
    flier, _ = along_a_route(bench)
    flier.fly(60.0)
    assert flier.speed_at_landing < STILL_M_S


def test_gap_following_lands_nowhere_that_has_turned_out_overgrown(bench):
    """Growth that it sees only when it has stopped makes it choose another position."""
    flier, node = along_a_route(bench)
    while not node._stop.has_begun:
        flier.tick()
    velocity = flier.velocity[:2]  # it stops right there
    x, y = flier.position[:2] + velocity * np.hypot(*velocity) / (2.0 * BRAKES_M_S2)
    for k in range(6):
        node._low_obstacles.add(np.array([[x, y, 1.5]]), bench.now_ns + k)
    flier.fly(60.0)
    assert flier.speed_at_landing < STILL_M_S
    assert math.dist(flier.landed_at[:2], (x, y)) > 1.0


def test_gap_following_lands_in_the_end_where_all_is_overgrown(bench):
    flier, node = along_a_route(bench)
    grid = np.array([[x, y, 1.5] for x, y in itertools.product(np.arange(-10, 10, 0.5), repeat=2)])
    while flier.landed_at is None and bench.now_ns < 200e9:
        if node._stop.has_begun:
            middle = [*flier.position[:2], 0.0]
            for k in range(3):
                node._low_obstacles.add(grid + middle, bench.now_ns + k)
        flier.tick()
    assert flier.landed_at is not None
    assert flier.speed_at_landing < STILL_M_S


class Straight(DepthCourse):
    """Flies along the course at its speed."""

    def __init__(self, **options):
        super().__init__("straight", **options)

    def look(self, image, info, pose):
        pass

    def steer(self, pose):
        return self.speed * np.array([math.cos(self.course), math.sin(self.course)]), 0.0


def test_a_depth_course_stops_before_it_lands(bench):
    node = bench.start(Straight, distance_m=12.0, speed_m_s=4.0)
    flier = Flier(bench)
    image, info = zero_message("sensor_msgs/msg/Image"), zero_message("sensor_msgs/msg/CameraInfo")
    assert isinstance(image, Image)
    assert isinstance(info, CameraInfo)
    bench.send("/uav1/camera/camera_info", info)
    while flier.landed_at is None and bench.now_ns < 60e9:
        bench.send("/uav1/camera/depth", image)
        flier.tick()
    assert flier.speed_at_landing < STILL_M_S
    assert node.phase is DepthCoursePhase.LAND
    assert 12.0 < flier.landed_at[0] < 12.0 + 4.0**2 / BRAKES_M_S2


class Searcher(Flier):
    """Rises by `take_off_to` and flies to goals at 4 m/s, which it passes before it turns back."""

    def __init__(self, bench):
        super().__init__(bench)
        self._goals = bench.listen("/uav1/planning/goal")
        bench.graph.create_service(
            "/uav1/take_off_to", "volery_interfaces/srv/TakeOffTo", self._rise
        )

    def _rise(self, request):
        self.flies, self.height = True, request.altitude
        return message_type("volery_interfaces/srv/TakeOffTo_Response")(True, "")

    def tick(self):
        if self.flies:
            wanted = np.array([0.0, 0.0, 2.0 * (self.height - self.position[2])])
            if self._goals:
                goal = self._goals[-1].pose.position
                offset = np.array([goal.x, goal.y]) - self.position[:2]
                wanted[:2] = offset * min(2.0, 4.0 / max(float(np.hypot(*offset)), 1e-9))
            x, y, z = map(float, np.clip(wanted, -4.0, 4.0))
            self._commands.append(Twist(Vector3(x, y, z), Vector3(0.0, 0.0, 0.0)))
        super().tick()


def test_a_task_manager_stops_over_home_before_it_lands(bench):
    """The path home leads past it at 4 m/s: no position for a command to land."""
    node = bench.start(TaskManager, area_m=[20.0, -10.0, 40.0, 10.0], gather_s=1.0)
    searcher = Searcher(bench)
    while node.phase is not MissionPhase.SEARCH and bench.now_ns < 60e9:
        searcher.tick()
    searcher.position[:2] = [20.0, 0.0]
    bench.call("/uav1/task_manager/return_home")
    passed = False
    while searcher.landed_at is None and bench.now_ns < 200e9:
        searcher.tick()
        speed, away = np.hypot(*searcher.velocity[:2]), np.hypot(*searcher.position[:2])
        passed = passed or (away < 1.5 and speed > 2.0)
    assert passed
    assert searcher.speed_at_landing < STILL_M_S
    assert node.phase is MissionPhase.LAND
    assert np.hypot(*searcher.landed_at[:2]) < 1.5


def test_a_covered_area_is_left_standing():
    flight = CoverageFlight("uav1")
    flight.send(WaypointProgress(np.zeros((1, 3)), np.array([True])), 0)
    flight.moved(np.zeros(3), 0.0, 0, speed_m_s=3.0)
    assert flight.goal(0.3, 0) is None
    assert not flight.has_stopped(1_000_000_000)
    flight.moved(np.zeros(3), 0.0, 0, speed_m_s=0.1)
    assert flight.has_stopped(1_000_000_000)
    flight.moved(np.zeros(3), 0.0, 0, speed_m_s=0.9)
    assert flight.has_stopped(9_000_000_000)  # in gusts


def test_the_coverage_planner_stops_at_its_last_goal_before_it_lands(bench):
    """A UAV that is at each goal at once, and fast: it lands when it has stopped there."""
    landed = []

    def land(_request):
        landed.append(bench.now_ns)
        return answer()

    bench.graph.create_service("/uav1/land", "std_srvs/srv/Trigger", land)
    bench.graph.create_service("/uav1/take_off", "std_srvs/srv/Trigger", lambda _: answer())
    node = bench.start(CoveragePlanner, uavs=["uav1"])
    goals = bench.listen("/uav1/goal_pose")
    grid = zero_message("nav_msgs/msg/OccupancyGrid")
    grid.header.frame_id = "map"
    grid.info.resolution, grid.info.width, grid.info.height = 2.0, 2, 2
    grid.info.origin.orientation.w = 1.0
    grid.data = np.zeros(4, np.int8)
    bench.send("/map", grid)
    position, speed = np.array([1.0, 1.0, 0.1]), 0.0

    def fly(seconds):
        nonlocal position
        for _ in range(round(seconds / 0.1)):
            if goals:
                last = goals[-1].pose.position
                position = np.array([last.x, last.y, last.z])
            now = bench.now_ns + 100_000_000
            bench.send("/uav1/odom", odometry(now, position, (speed, 0.0, 0.0), frame="map"))
            bench.run_to(now)

    fly(0.5)
    position, speed = np.array([1.0, 1.0, 2.5]), 3.0  # it has taken off
    flight = node._flights[0]
    while flight.waypoints is None or flight.goal(0.3, bench.now_ns) is not None:
        fly(0.1)
        assert bench.now_ns < 60e9
    fly(1.0)
    assert not landed
    speed = 0.1
    fly(0.3)
    assert len(landed) == 1


def test_a_stop_in_gusts_ends_all_the_same():
    stop = Stop()
    assert not stop.is_over(sample(0.0), 0)
    stop.begin(1_000_000_000)
    stop.begin(9_000_000_000)
    assert not stop.is_over(sample(1.0), 2_000_000_000)
    assert stop.is_over(sample(0.1), 2_000_000_000)
    assert stop.is_over(sample(1.0), 7_000_000_000)
