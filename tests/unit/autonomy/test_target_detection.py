"""Targets by camera: what single sightings know, how they are joined, and the node on images."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from team_bench import Clockwork, S

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.ground_view import GroundView, Intrinsics
from volery.autonomy.team.observations import PositionUncertainty, Tracks, sighting_of
from volery.autonomy.team.target_detection import TargetDetection
from volery.core import rotations
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import (
    Image,
    Odometry,
    Point,
    PoseWithCovariance,
    Published,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
)
from volery.graph.messages import Pose as PoseMessage
from volery.graph.nodes.node import Context

EXACT = PositionUncertainty(0.03, 0.0, 0.0)


def test_a_ray_is_surer_across_than_along() -> None:
    seen = sighting_of(0, np.array([0.0, 0.0, 3.0]), np.array([0.0, 8.0, 0.5]), EXACT)
    # the position moves by dr = (r^2 + h^2) / h da, as the derivative of r = h / tan(a) says
    h, r = 2.5, 8.0
    a = math.atan2(h, r)
    moved = h / math.tan(a - 1e-6) - r
    assert math.sqrt(seen.covariance[1, 1]) == pytest.approx(moved / 1e-6 * 0.03, rel=1e-4)
    assert math.sqrt(seen.covariance[0, 0]) == pytest.approx(8.0 * 0.03)
    sloped = sighting_of(
        0, np.array([0.0, 0.0, 3.0]), np.array([0.0, 8.0, 0.5]), PositionUncertainty(0.0, 0.1)
    )
    assert math.sqrt(sloped.covariance[1, 1]) == pytest.approx(
        math.hypot(0.1 * 8.0 * 8.0 / 2.5, 0.2)
    )


def test_joined_sightings_are_as_good_as_they_say() -> None:
    """Normalised errors of 400 targets seen from all sides, against chi squared."""
    random = np.random.default_rng(5)
    truth, ratios = np.array([4.0, -2.0, 0.5]), []
    for _ in range(400):
        tracks = Tracks()
        for k in range(6):
            side = random.uniform(0.0, 2.0 * math.pi)
            eye = truth + np.array([9.0 * math.cos(side), 9.0 * math.sin(side), 2.5])
            exact = sighting_of(k * S, eye, truth, EXACT)
            error = np.linalg.cholesky(exact.covariance) @ random.standard_normal(2)
            tracks.add(exact._replace(position=truth + np.array([*error, 0.0])))
        track = max(tracks.tracks, key=lambda t: t.count)
        off = track.position - truth[:2]
        ratios.append(float(off @ np.linalg.inv(track.covariance) @ off))
    assert np.mean(ratios) == pytest.approx(2.0, abs=0.35)


def test_it_takes_several_sightings_and_a_good_place() -> None:
    tracks = Tracks(sightings=3, within_s=0.5, spread_m=1.0)
    eye, there = np.array([0.0, 0.0, 3.0]), np.array([3.0, 0.0, 0.5])
    counts = []
    for k in range(5):
        tracks.add(sighting_of(round(0.2 * k * S), eye, there, EXACT))
        counts.append(len(tracks.detections("uav1")))
    assert counts == [0, 0, 0, 1, 1]  # the third comes within half a second of the first
    far = sighting_of(S, eye, np.array([16.0, 0.0, 0.5]), EXACT)
    for _ in range(4):
        tracks.add(far)
    assert len(tracks.detections("uav1")) == 1  # 3.3 m are too wide
    (found,) = tracks.detections("uav1")
    assert found.position[:2] == pytest.approx((3.0, 0.0))
    assert (found.finder, found.number, found.sightings) == ("uav1", 1, 5)


def test_two_things_are_two_tracks_and_a_flash_is_forgotten() -> None:
    tracks = Tracks(sightings=2, within_s=0.1, forget_s=5.0)
    eye = np.array([0.0, 0.0, 3.0])
    tracks.add(sighting_of(0, eye, np.array([-4.0, 0.0, 0.5]), EXACT))
    for k in (1, 2):
        tracks.add(sighting_of(k * S, eye, np.array([4.0, 0.0, 0.5]), EXACT))
        tracks.add(sighting_of(k * S, eye, np.array([0.0, 5.0, 0.5]), EXACT))
    assert len(tracks.detections("uav1")) == 2
    tracks.add(sighting_of(9 * S, eye, np.array([4.0, 0.0, 0.5]), EXACT))
    assert [track.count for track in tracks.tracks] == [3, 2]


# ------------------------------------------------------------------------------------- the node

K = Intrinsics(80.0, 80.0, 79.5, 59.5)
MOUNT = {"mount_m": [0.12, 0.0, 0.0], "mount_rpy_deg": [0.0, 30.0, 0.0]}


class Onlooker:
    """Hands a detector odometry, range and images of a red ball."""

    def __init__(self) -> None:
        self.clock = Clockwork()
        self.graph = Graph(lambda: self.clock.now_ns)
        context = Context(self.graph, self.clock, lambda: self.clock.now_ns)
        TargetDetection(context=context, namespace="/uav1", parameter_overrides=MOUNT)
        self.received: list[Any] = []
        self.graph.subscribe("/uav1/target_detection/targets", self._receive)
        info = zero_message("sensor_msgs/msg/CameraInfo")
        info.k = np.array([K.fx, 0.0, K.cx, 0.0, K.fy, K.cy, 0.0, 0.0, 1.0])
        self.say("camera/camera_info", info)

    def _receive(self, published: Published) -> None:
        self.received.append(published.message)

    def say(self, topic: str, message: Any) -> None:
        self.graph.advertise(f"/uav1/{topic}", message.__msgtype__).publish(message)
        self.graph.deliver()

    def look(self, position: np.ndarray, yaw: float, thing: np.ndarray, colour: Any) -> None:
        """An image from `position`, 0.2 s after the last one; the ground is at 10 m."""
        self.clock.now_ns += S // 5
        now = self.clock.now_ns
        attitude = rotations.from_rpy(0.0, 0.0, yaw)
        pose = PoseMessage(Point(*position.tolist()), Quaternion(*attitude.tolist()))
        still = Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0))
        self.say(
            "odom",
            Odometry(
                header(now, "map"),
                "base",
                PoseWithCovariance(pose, np.zeros(36)),
                TwistWithCovariance(still, np.zeros(36)),
            ),
        )
        below = zero_message("sensor_msgs/msg/Range")
        below.header, below.range = header(now, "range"), float(position[2] - 10.0)
        self.say("range", below)
        image = np.full((120, 160, 3), (60, 90, 50), np.uint8)
        view = GroundView(K, MOUNT["mount_m"], MOUNT["mount_rpy_deg"])
        still_pose = OdometrySample(now, position, attitude, np.zeros(3), np.zeros(3))
        disc = view.disc_of(thing, 0.5, still_pose)
        if disc is not None:
            v, u = np.mgrid[:120, :160]
            image[(u - disc[0]) ** 2 + (v - disc[1]) ** 2 <= disc[2] ** 2] = colour
        data = image.reshape(-1)
        self.say("camera/image_raw", Image(header(now, "c"), 120, 160, "rgb8", 0, 480, data))


@pytest.mark.parametrize(("colour", "found"), [((200, 20, 20), True), ((20, 20, 200), False)])
def test_a_ball_is_placed_where_it_is(colour: Any, found: bool) -> None:
    looks, ball = Onlooker(), np.array([12.0, 5.0, 10.5])
    for k in range(10):
        position = np.array([4.0 + 0.5 * k, 4.0, 13.0])
        looks.look(position, 0.1, ball, colour)
    assert bool(looks.received) == found
    if found:
        (target,) = looks.received[-1].targets
        assert (target.position.x, target.position.y) == pytest.approx((12.0, 5.0), abs=0.25)
        assert target.position.z == pytest.approx(10.5, abs=0.01)
        assert 0.05 < math.sqrt(target.covariance[0]) < 1.5
        assert (target.finder, target.number) == ("uav1", 1)


def test_a_red_teammate_is_no_target() -> None:
    looks, mate = Onlooker(), np.array([9.0, 4.5, 11.5])
    report = zero_message("volery_interfaces/msg/TeamReport")
    report.name, report.position = "uav2", Point(*mate.tolist())
    for k in range(10):
        looks.say("radio/team", report)
        looks.look(np.array([4.0 + 0.2 * k, 4.0, 13.0]), 0.1, mate, (200, 20, 20))
    assert looks.received == []


def test_nothing_is_placed_without_knowing_the_ground() -> None:
    looks, ball = Onlooker(), np.array([12.0, 5.0, 10.5])
    for k in range(10):
        looks.look(np.array([4.0 + 0.5 * k, 4.0, 10.0 + math.nan]), 0.1, ball, (200, 20, 20))
    assert looks.received == []
