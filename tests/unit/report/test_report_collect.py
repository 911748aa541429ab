from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from volery.core import rotations
from volery.engine.events import Event, EventKind
from volery.graph import messages as m
from volery.graph.topics import Subscription
from volery.report.collect import FlightCollector
from volery.report.scan_placing import scan_points
from volery.sensors.mount import make_mount
from volery.world.terrain import Terrain

MS = 1_000_000


class FakeGraph:
    def __init__(self) -> None:
        self.callbacks: dict[str, list[Callable[[m.Published], None]]] = {}

    def subscribe(self, topic: str, callback: Callable[[m.Published], None], msgtype: str) -> Any:
        callbacks = self.callbacks.setdefault(topic, [])
        callbacks.append(callback)
        return Subscription(callbacks, callback)

    def send(self, topic: str, time_ns: int, message: Any) -> None:
        for callback in self.callbacks.get(topic, []):
            callback(m.Published(topic, m.type_name(type(message)), time_ns, message))


@dataclass
class FakeSimulation:
    """One UAV flying east at 5 m/s, 3 m above flat ground, turning left at 0.8 rad/s."""

    graph: FakeGraph = field(default_factory=FakeGraph)
    uavs: tuple[str, ...] = ("uav1",)
    vehicles: Any = field(
        default_factory=lambda: SimpleNamespace(lidar_mounts=dict(MOUNTS), point_cloud_mounts={})
    )
    diagnostics: Any = field(
        default_factory=lambda: SimpleNamespace(events=[], stage_seconds={"lidars": 0.5})
    )
    time_ns: int = 2_000 * MS
    scenario: Any = field(
        default_factory=lambda: SimpleNamespace(
            name="fake", description="", seed=4, duration_s=10.0
        )
    )

    @property
    def world(self) -> Any:
        def clearance(points: Any, reach_m: float, include_terrain: bool = True) -> Any:
            assert not include_terrain
            return SimpleNamespace(distance=np.minimum(np.abs(points[:, 0] - 5.0), reach_m))

        return SimpleNamespace(
            terrain=Terrain.flat(200.0, 1.0, (-100.0, -100.0)),
            forest=None,
            scene=SimpleNamespace(clearance=clearance, solids=()),
        )


def pose_at(t: Any) -> tuple[np.ndarray, np.ndarray]:
    t = np.asarray(t, dtype=np.float64)
    position = np.stack([5.0 * t, 0.0 * t, 4.0 + 0.0 * t], axis=-1)
    return position, rotations.from_rpy(0.05, 0.1, 0.8 * t)


def odometry(time_ns: int) -> Any:
    p, q = pose_at(time_ns / 1e9)
    pose = m.PoseWithCovariance(m.Pose(m.Point(*p), m.Quaternion(*q)), np.zeros(36))
    velocity = m.Twist(m.Vector3(3.0, 4.0, 0.0), m.Vector3(0.0, 0.0, 0.8))
    twist = m.TwistWithCovariance(velocity, np.zeros(36))
    return m.Odometry(m.header(time_ns, "map"), "uav1/base_link", pose, twist)


MOUNTS = {
    "/uav1/laser/horizontal/scan": make_mount((0.0, 0.0, 0.1)),
    "/uav1/laser/nodding/scan": make_mount(
        (0.1, 0.02, -0.05),
        rotations.from_rpy(0.0, 0.2, 0.1),
        amplitude_rad=0.7,
        period_s=2.0,
        offset_rad=0.2,
        phase_rad=0.3,
    ),
}


def wall_scan(topic: str, start_ns: int) -> Any:
    """A LaserScan of the plane x = 30 of the map, every beam from its own pose."""
    mount = MOUNTS[topic]
    beams = 1081
    step = 2.35619449 * 2 / (beams - 1)
    tick = 0.75 * 0.025 / 1080
    t = start_ns / 1e9 + np.arange(beams) * tick
    azimuth = -2.35619449 + np.arange(beams) * step
    nod = np.zeros(beams)
    if mount.nods:
        turn = 2 * np.pi * t / mount.period_s + mount.phase_rad
        nod = mount.offset_rad + mount.amplitude_rad * np.sin(turn)
    flat = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(beams)], axis=-1)
    d = rotations.rotate(rotations.from_rpy(0.0, nod, 0.0), flat)
    p, q = pose_at(t)
    direction = rotations.rotate(q, rotations.rotate(mount.attitude_body, d))
    origin = p + rotations.rotate(q, mount.position_body)
    ahead = direction[:, 0] > 1e-6
    distance = np.full(beams, np.inf)
    distance[ahead] = (30.0 - origin[ahead, 0]) / direction[ahead, 0]
    ranges = np.where(distance < 27.0, distance, np.inf).astype(np.float32)
    return m.LaserScan(
        m.header(start_ns, "laser"),
        -2.35619449,
        2.35619449,
        step,
        tick,
        0.025,
        0.1,
        30.0,
        ranges,
        np.zeros(0, np.float32),
    )


@pytest.mark.parametrize("topic", sorted(MOUNTS))
def test_beams_return_to_the_wall(topic: str) -> None:
    """Motion of the body and nodding during a sweep are undone to within centimetres."""
    from collections import deque

    poses = deque((t * MS, odometry(t * MS).pose.pose) for t in range(1000, 1100, 10))
    scan = wall_scan(topic, 1_015 * MS)
    points = scan_points(scan, MOUNTS[topic], poses)
    assert points is not None
    assert len(points) > 100
    assert np.abs(points[:, 0] - 30.0).max() < 0.02
    moving = scan_points(scan, MOUNTS[topic], deque([poses[1], poses[2]]))
    assert moving is not None
    assert scan_points(scan, MOUNTS[topic], deque()) is None


def test_points_of_a_cloud_return_to_the_wall() -> None:
    """A sweep of 100 ms while the body flies and turns."""
    from collections import deque

    from volery.sensors.lidar.point_cloud import POINT

    start_ns, mount = 1_015 * MS, MOUNTS["/uav1/laser/horizontal/scan"]
    t = start_ns / 1e9 + np.linspace(0.0, 0.1, 500)
    azimuth = np.linspace(-0.9, 0.9, 500)
    beam = np.stack([np.cos(azimuth), np.sin(azimuth), 0.1 * np.sin(9 * azimuth)], axis=-1)
    p, q = pose_at(t)
    origin, direction = p + rotations.rotate(q, mount.position_body), rotations.rotate(q, beam)
    distance = (20.0 - origin[:, 0]) / direction[:, 0]
    points = np.zeros(500, POINT)
    for i, axis in enumerate("xyz"):
        points[axis] = distance * beam[:, i]
    points["time"] = t - t[0]
    fields = [m.PointField("x", 0, m.PointField.FLOAT32, 1)]
    cloud = m.PointCloud2(
        m.header(start_ns, "laser"), 1, 500, fields, False, 22, 11000, points.view(np.uint8), True
    )
    poses = deque((k * MS, odometry(k * MS).pose.pose) for k in range(1000, 1140, 20))
    found = scan_points(cloud, mount, poses)
    assert found is not None
    assert 200 < len(found) < 500  # what lies beyond 28 m is left out
    assert np.abs(found[:, 0] - 20.0).max() < 0.02


def test_collects_a_flight(tmp_path: Path) -> None:
    simulation = FakeSimulation()
    simulation.diagnostics.events.append(
        Event(1_500 * MS, "uav1", EventKind.COLLISION, (7.5, 0.0, 4.0), 5.0, "tree 3")
    )
    collector = FlightCollector(simulation)
    for t in range(0, 2000, 5):
        if t % 25 == 20 and t > 25:
            for topic in MOUNTS:
                simulation.graph.send(topic, t * MS, wall_scan(topic, (t - 20) * MS))
        simulation.graph.send("/uav1/ground_truth/odom", t * MS, odometry(t * MS))
    flight = collector.finish(0.5, digest="abc", log_path=tmp_path / "x.mcap", log_messages=3)
    (track,) = flight.uavs
    assert len(track.time_s) == 40
    assert np.diff(track.time_s).min() >= 0.0499
    np.testing.assert_allclose(track.speed_m_s, 5.0)
    np.testing.assert_allclose(track.height_m, 3.0)
    assert track.minimum_clearance_m == pytest.approx(0.0, abs=1e-9)
    assert flight.lidar is not None
    assert np.abs(flight.lidar.points_map[:, 0] - 30.0).max() < 0.3
    # of the 80 scans sent in a simulated second, at most 24 are mapped
    assert 25 <= flight.lidar.scans <= 2 * 24 + 4
    assert flight.contacts == 1
    assert flight.real_time_factor == pytest.approx(4.0)
    assert (flight.scenario, flight.seed, flight.digest) == ("fake", 4, "abc")
    np.testing.assert_allclose(
        flight.lidar.height_m, flight.lidar.points_map[:, 2] - 1.0, atol=1e-4
    )


def test_trees_are_sized_by_their_crowns() -> None:
    from volery.figures.trees import trees_of

    ring = np.array([[2.0, 0, 3], [0, 2.0, 3], [-2.0, 0, 3]], np.float32)
    leaves = SimpleNamespace(vertices=ring)
    wood = SimpleNamespace(vertices=ring * 0.1)
    bare = SimpleNamespace(vertices=ring[:0])
    green = SimpleNamespace(levels={"coarse": SimpleNamespace(leaves=leaves, wood=wood)})
    dead = SimpleNamespace(levels={"coarse": SimpleNamespace(leaves=bare, wood=wood)})
    forest = SimpleNamespace(
        models=(green, dead),
        model_index=np.array([1, 0, 0]),
        position_map=np.zeros((3, 3)),
        scale=np.array([[1.0, 1, 1], [1, 1, 1], [2, 2, 1]]),
        dbh_m=np.array([0.1, 0.2, 0.3]),
    )
    trees = trees_of(forest)
    assert trees is not None
    np.testing.assert_allclose(trees.crown_radius_m, [0.2, 2.0, 4.0], rtol=1e-6)
    assert trees_of(None) is None
