"""A team without physics: task managers on one graph, UAVs that fly straight, a radio that errs."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

import numpy as np

from volery.autonomy.team.task_manager import TaskManager
from volery.core import rng
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import (
    BatteryState,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Published,
    Quaternion,
    Range,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
    message_type,
)
from volery.graph.nodes.node import Context

S = 1_000_000_000
AREA = [0.0, 0.0, 80.0, 60.0]
_NOTHING = np.zeros(36)
_SPEED_M_S, _LANE_M, _MOVE_S = 5.0, 8.0, 0.2


class Clockwork:
    """Timers of a clock that the test moves."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._due: list[tuple[int, int, Callable[[], Any]]] = []
        self._count = 0

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        self._count += 1
        heapq.heappush(self._due, (time_ns, self._count, action))

    def forget(self, callback: Callable[[], Any]) -> None:
        """Its `wanted` says so."""

    def every(self, period_s: float, callback: Callable[[], Any], *, wanted: Any = None) -> None:
        period = round(period_s * S)

        def ring() -> None:
            if wanted is None or wanted():
                callback()
            self.at(self.now_ns + period, ring)

        self.at(self.now_ns + period, ring)

    def run_to(self, time_ns: int, deliver: Callable[[], None]) -> None:
        while self._due and self._due[0][0] <= time_ns:
            self.now_ns, _, action = heapq.heappop(self._due)
            action()
            deliver()
        self.now_ns = time_ns


class FakeUav:
    """Rises, lands, sweeps `search_area` in lanes and flies to goals, through everything."""

    def __init__(self, bench: TeamBench, name: str, home: tuple[float, float]) -> None:
        self._bench, self.name = bench, name
        self.position = np.array([*home, 0.0])
        self.flies = False
        self.stuck = False
        self.silent = False
        self.charge = 1.0
        self.climb_limit_m = np.inf
        """Height at which a take-off ends, if not at the one that is asked for."""
        self.asked: list[str] = []
        """Flight modes that were asked for."""
        self.paused = False
        """Whether its planners are paused, so that they command nothing."""
        self.frame = "map"
        """Of its odometry."""
        self.waypoints: list[np.ndarray] = []
        graph = bench.graph
        self.odometry = graph.advertise(f"/{name}/odom", Odometry)
        self.battery = graph.advertise(f"/{name}/battery", BatteryState)
        trigger = message_type("std_srvs/srv/Trigger_Response")
        rise = message_type("volery_interfaces/srv/TakeOffTo_Response")

        def take_off(request: Any) -> Any:
            self.asked.append("take_off_to")
            self.flies, self.position[2] = True, min(request.altitude, self.climb_limit_m)
            return rise(True, "")

        def hold(_request: Any) -> Any:
            self.asked.append("hold")
            return trigger(True, "")

        def land(_request: Any) -> Any:
            self.asked.append("land")
            self.flies, self.position[2] = False, 0.0
            return trigger(True, "")

        graph.create_service(f"/{name}/take_off_to", "volery_interfaces/srv/TakeOffTo", take_off)
        graph.create_service(f"/{name}/land", "std_srvs/srv/Trigger", land)
        graph.create_service(f"/{name}/hold", "std_srvs/srv/Trigger", hold)
        self.sonar = graph.advertise(f"/{name}/range", Range)
        graph.subscribe(f"/{name}/cmd_vel", self._climb, "geometry_msgs/msg/Twist")
        graph.subscribe(f"/{name}/planning/pause", self._pause, "std_msgs/msg/Bool")
        graph.subscribe(f"/{name}/search_area", self._sweep, "geometry_msgs/msg/PolygonStamped")
        graph.subscribe(f"/{name}/planning/goal", self._go, "geometry_msgs/msg/PoseStamped")
        bench.clock.every(_MOVE_S, self._move)

    def _pause(self, published: Published) -> None:
        self.paused = published.message.data
        self.waypoints = []

    def _sweep(self, published: Published) -> None:
        corners = published.message.polygon.points
        self.waypoints = []
        if corners:
            (x0, y0), (x1, y1) = ((corners[k].x, corners[k].y) for k in (0, 2))
            for k, y in enumerate(np.arange(y0 + _LANE_M / 2.0, y1, _LANE_M)):
                ends = (x0, x1) if k % 2 == 0 else (x1, x0)
                self.waypoints += [np.array([x, y]) for x in ends]

    def _go(self, published: Published) -> None:
        p = published.message.pose.position
        self.waypoints = [np.array([p.x, p.y])]

    def _climb(self, published: Published) -> None:
        if self.flies:
            self.position[2] += _MOVE_S * published.message.linear.z

    def measure(self, range_m: float) -> None:
        """Say what the sonar measures."""
        message = zero_message("sensor_msgs/msg/Range")
        message.range = range_m
        self.sonar.publish(message)

    def _move(self) -> None:
        step = _MOVE_S * _SPEED_M_S
        if self.flies and self.waypoints and not self.stuck and not self.paused:
            to = self.waypoints[0] - self.position[:2]
            away = float(np.linalg.norm(to))
            self.position[:2] += to * min(step / max(away, 1e-9), 1.0)
            if away <= step:
                self.waypoints.pop(0)
        if self.silent:
            return
        now = self._bench.clock.now_ns
        pose = Pose(Point(*self.position.tolist()), Quaternion(0.0, 0.0, 0.0, 1.0))
        still = TwistWithCovariance(Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)), _NOTHING)
        message = Odometry(
            header(now, self.frame), "base", PoseWithCovariance(pose, _NOTHING), still
        )
        self.odometry.publish(message)
        battery = zero_message("sensor_msgs/msg/BatteryState")
        battery.percentage = self.charge
        self.battery.publish(battery)


class TeamBench:
    """UAVs whose `team` topics reach the others unless `is_connected(from, to)` says no.

    lost: fraction of reports that is lost, each by itself; doubled: fraction that comes twice, the
    second time a second late.
    """

    def __init__(
        self, homes: dict[str, tuple[float, float]], lost: float = 0.0, doubled: float = 0.0
    ) -> None:
        self.clock = Clockwork()
        self.graph = Graph(lambda: self.clock.now_ns)
        self.uavs: dict[str, FakeUav] = {}
        self.managers: dict[str, TaskManager] = {}
        self.is_connected: Callable[[str, str], bool] = lambda _one, _other: True
        self._lost, self._doubled, self._num_reports = lost, doubled, 0
        for name, home in homes.items():
            self.add(name, home)

    def add(self, name: str, home: tuple[float, float], **parameters: Any) -> None:
        """A UAV with its task manager, from now on."""
        self.uavs[name] = FakeUav(self, name, home)
        context = Context(self.graph, self.clock, lambda: self.clock.now_ns)
        self.managers[name] = TaskManager(
            context=context,
            namespace=f"/{name}",
            parameter_overrides={"area_m": AREA, "sector_m": 20.0, **parameters},
        )
        self.graph.subscribe(f"/{name}/team", lambda published: self._relay(name, published))

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.run_to(self.clock.now_ns + round(seconds * S), self.graph.deliver)

    def order(self, name: str, order: str) -> str:
        """What a task manager answers to an operator's order; `GraphError` where it refuses."""
        response = self.graph.call(f"/{name}/task_manager/{order}")
        if not response.success:
            raise GraphError(response.message)
        return str(response.message)

    def phases(self) -> dict[str, str]:
        """Of all task managers."""
        return {name: str(manager.phase) for name, manager in self.managers.items()}

    def _relay(self, source: str, published: Published) -> None:
        key = rng.stream_key(1, "team bench")
        for name in self.uavs:
            if name == source or not self.is_connected(source, name):
                continue
            self._num_reports += 1
            deliver = self._delivery(name, published.message)
            if float(rng.uniform(key, 2 * self._num_reports)) >= self._lost:
                self.clock.at(self.clock.now_ns + 5_000_000, deliver)
            if float(rng.uniform(key, 2 * self._num_reports + 1)) < self._doubled:
                self.clock.at(self.clock.now_ns + S, deliver)

    def _delivery(self, name: str, message: Any) -> Callable[[], None]:
        topic = f"/{name}/radio/team"
        publisher = self.graph.advertise(topic, "volery_interfaces/msg/TeamReport")
        return lambda: publisher.publish(message)
