from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from held_ports import held_port

from volery.graph import messages as m


def make_flight(seconds: float = 2.0) -> list[m.Published]:
    """Messages of every type that a run publishes, in time order."""
    rng = np.random.default_rng(7)
    found: list[m.Published] = []

    def add(topic: str, time_ns: int, message: object) -> None:
        found.append(m.Published(topic, m.type_name(type(message)), time_ns, message))

    zeros = np.zeros(9)
    for k in range(round(seconds * 40)):
        t = k * 25_000_000
        header = m.header(t, "uav1/base_link")
        vector = m.Vector3(x=0.1 * k, y=0.0, z=-9.81)
        pose = m.Pose(m.Point(k * 0.1, 1.0, 2.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
        ranges = rng.uniform(0.1, 30.0, 1081).astype(np.float32)
        ranges[::3] = np.inf
        scan = m.LaserScan(
            header, -2.35, 2.35, 0.00436, 1.7e-5, 0.025, 0.1, 30.0, ranges, np.zeros(0, np.float32)
        )
        add("/clock", t, m.Clock(m.time_from_ns(t)))
        add("/uav1/laser/horizontal/scan", t, scan)
        add("/uav1/imu", t, m.Imu(header, pose.orientation, zeros, vector, zeros, vector, zeros))
        add("/uav1/range", t, m.Range(header, 0, 0.5, 0.1, 8.0, 2.5, 0.01))
        twist = m.Twist(vector, vector)
        covariance = np.zeros(36)
        add(
            "/uav1/odom",
            t,
            m.Odometry(
                header,
                "uav1/base_link",
                m.PoseWithCovariance(pose, covariance),
                m.TwistWithCovariance(twist, covariance),
            ),
        )
        add("/uav1/cmd_vel", t, twist)
        add("/uav1/goal_pose", t, m.PoseStamped(header, pose))
        transform = m.Transform(vector, pose.orientation)
        frames = [m.TransformStamped(header, "uav1/base_link", transform)]
        add("/tf", t, m.TFMessage(frames))
        angles = np.array([0.25])
        add("/uav1/joint_states", t, m.JointState(header, ["nod"], angles, angles, np.zeros(0)))
        add("/uav1/status", t, m.String("hold"))
    return found


@pytest.fixture
def flight() -> Callable[[float], list[m.Published]]:
    return make_flight


@pytest.fixture
def hold_port() -> Iterator[Callable[[], int]]:
    """Ports that stay the test's own, also while no server listens there."""
    with ExitStack() as held:
        yield lambda: held.enter_context(held_port())
