"""A simulation without physics: it publishes on a real graph, for tests of the command line."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from volery.engine.events import Event, EventKind
from volery.graph import messages as m
from volery.graph.graph import Graph
from volery.sensors.mount import make_mount
from volery.world.terrain import Terrain

STEP_NS = 25_000_000
SCAN = "/uav1/laser/horizontal/scan"


class FakeDiagnostics:
    image_rates: dict[str, float] = {}  # noqa: RUF012
    stage_seconds = {"lidars": 0.2, "dynamics": 0.1}  # noqa: RUF012

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._digest = False

    def enable_digest(self) -> None:
        self._digest = True

    def digest(self, *, by_topic: bool = False) -> str:
        assert self._digest
        return "ab" * 32


def _clearance(points: Any, max_range_m: float, include_terrain: bool = True) -> Any:
    return SimpleNamespace(distance=np.full(len(points), max_range_m))


class FakeSimulation:
    wall_s_per_step = 0.0
    made: list[FakeSimulation] = []  # noqa: RUF012

    def __init__(
        self, scenario: Any, threads: int = 1, recordings: Any = None, on_load: Any = None
    ) -> None:
        self.scenario = scenario.with_(expect=[])  # it records no states to judge
        self.threads = threads
        self.time_ns = 0
        self.graph = Graph(lambda: self.time_ns)
        self.gateway = None
        self.commands = SimpleNamespace(end=lambda: None)
        self.uavs = {
            f"uav{k + 1}": SimpleNamespace(crashed=False) for k in range(scenario.uav_count)
        }
        self.clock = SimpleNamespace(
            paused=False, paused_s=0.0, speed=None, quitting=False, quit=lambda: None
        )
        self.vehicles = SimpleNamespace(
            lidar_mounts={SCAN: make_mount((0.0, 0.0, 0.1))}, point_cloud_mounts={}
        )
        self.world = SimpleNamespace(
            terrain=Terrain.flat(100.0, 0.0, (-50.0, -50.0)),
            forest=None,
            city=None,
            scene=SimpleNamespace(clearance=_clearance, solids=()),
        )
        self.diagnostics = FakeDiagnostics()
        self.closed = False
        self._odom = self.graph.advertise("/uav1/ground_truth/odom", m.Odometry)
        self._scan = self.graph.advertise(SCAN, m.LaserScan)
        FakeSimulation.made.append(self)

    @property
    def time_s(self) -> float:
        return self.time_ns / 1e9

    def run(
        self, seconds: float | None = None, *, speed: float | None = None, on_progress: Any = None
    ) -> None:
        self.clock.speed = speed
        start = last_progress = time.perf_counter()
        while self.time_s < self.scenario.duration_s:
            self._publish()
            self.graph.deliver()
            self.time_ns += STEP_NS
            if self.wall_s_per_step:
                time.sleep(self.wall_s_per_step)
            now = time.perf_counter()
            if on_progress is not None and now - last_progress > 0.05:
                last_progress = now
                on_progress(
                    SimpleNamespace(
                        time_s=self.time_s,
                        duration_s=self.scenario.duration_s,
                        wall_s=now - start,
                        before_s=0.0,
                        real_time_factor=self.time_s / (now - start),
                    )
                )
        where = (1.0, 2.0, 3.0)
        self.diagnostics.events.append(
            Event(self.time_ns, "uav1", EventKind.COLLISION, where, 2.5, "tree 7")
        )

    def _publish(self) -> None:
        t = self.time_ns
        point = m.Point(t / 1e9, 0.0, 2.0)
        pose = m.PoseWithCovariance(m.Pose(point, m.Quaternion(0.0, 0.0, 0.0, 1.0)), np.zeros(36))
        velocity = m.Twist(m.Vector3(1.0, 0.0, 0.0), m.Vector3(0.0, 0.0, 0.0))
        twist = m.TwistWithCovariance(velocity, np.zeros(36))
        self._odom.publish(m.Odometry(m.header(t, "map"), "uav1/base_link", pose, twist))
        ranges = np.full(1081, 5.0, np.float32)
        ranges += np.random.default_rng(t).normal(0.0, 0.01, 1081).astype(np.float32)
        self._scan.publish(
            m.LaserScan(
                m.header(t, "uav1/laser"), -2.35, 2.35, 0.00436, 1.7e-5, 0.025, 0.1, 30.0, ranges,
                np.zeros(0, np.float32),
            )
        )  # fmt: skip

    def close(self) -> None:
        self.closed = True
