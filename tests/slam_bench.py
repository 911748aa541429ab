"""A flight through upright trunks over level ground, as exact sensor messages."""

from __future__ import annotations

import numpy as np
from node_bench import nod

from volery.core import rotations
from volery.graph.messages import Imu, LaserScan, Quaternion, Range, Vector3, header

S, MS = 1_000_000_000, 1_000_000
GRAVITY = 9.80665
BEAMS, FIRST, STEP = 1081, -2.3561945, 0.00436332
SWEEP_S = 0.01875
LEVEL, NODDING = np.array([0.0, 0.0, 0.18]), np.array([0.10, 0.0, -0.08])
UNKNOWN = np.zeros(9)
STAND_S, CLIMB_S = 1.5, 3.0


def trunks(count=90, half_m=30.0, seed=4, clear_m=2.0):
    """(K, 3): x, y and radius; none near the origin."""
    random = np.random.default_rng(seed)
    positions = random.uniform(-half_m, half_m, (4 * count, 2))
    positions = positions[np.hypot(*positions.T) > clear_m][:count]
    return np.column_stack([positions, random.uniform(0.04, 0.2, len(positions))])


class Flight:
    """Where the vehicle is: it stands, climbs to 3 m, then flies an arc, nose ahead."""

    def __init__(self, speed=2.0, radius=15.0):
        self.speed, self.radius = speed, radius

    def pose(self, time_s):
        """Position (3,) and yaw."""
        up = np.clip((time_s - STAND_S) / CLIMB_S, 0.0, 1.0)
        z = 0.2 + 2.8 * (up * up * (3.0 - 2.0 * up))
        along = max(time_s - STAND_S - CLIMB_S, 0.0)
        distance = self.speed * (along - np.tanh(along))  # gathers speed within two seconds
        turn = distance / self.radius
        x, y = self.radius * np.sin(turn), self.radius * (1.0 - np.cos(turn))
        return np.array([x, y, z]), turn

    def imu(self, time_s):
        """Rates and specific force in the body."""
        h = 2e-3
        before, here, after = (self.pose(time_s + k * h) for k in (-1, 0, 1))
        pull = (before[0] - 2.0 * here[0] + after[0]) / h**2 + [0.0, 0.0, GRAVITY]
        c, s = np.cos(here[1]), np.sin(here[1])
        rate = (after[1] - before[1]) / (2.0 * h)
        force = [c * pull[0] + s * pull[1], c * pull[1] - s * pull[0], pull[2]]
        return np.array([0.0, 0.0, rate]), np.array(force)


def nod_angle(time_s):
    """Angle and rate of the mount."""
    turn = 2.0 * np.pi * time_s
    return 0.785 * np.sin(turn), 0.785 * 2.0 * np.pi * np.cos(turn)


def cast(flight, woods, first_s, mount, nods, rng=None):
    """Ranges (BEAMS,) of a sweep, each beam from where it is cast."""
    fraction = np.linspace(0.0, 1.0, BEAMS)
    ends = [flight.pose(first_s + SWEEP_S * part) for part in (0.0, 1.0)]
    at = ends[0][0] + fraction[:, None] * (ends[1][0] - ends[0][0])
    yaw = ends[0][1] + fraction * (ends[1][1] - ends[0][1])
    angle = FIRST + STEP * np.arange(BEAMS)
    tilt = nod_angle(first_s + SWEEP_S * fraction)[0] if nods else np.zeros(BEAMS)
    x, y, z = np.cos(tilt) * np.cos(angle), np.sin(angle), -np.sin(tilt) * np.cos(angle)
    c, s = np.cos(yaw), np.sin(yaw)
    ray = np.stack([c * x - s * y, s * x + c * y, z], axis=1)
    start = at + np.stack(
        [c * mount[0] - s * mount[1], s * mount[0] + c * mount[1], np.full(BEAMS, mount[2])], 1
    )
    found = np.full(BEAMS, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(ray[:, 2] < 0.0, -start[:, 2] / ray[:, 2], found)
        flat = (ray[:, :2] ** 2).sum(axis=1)
        for tx, ty, radius in woods:
            to = np.array([tx, ty]) - start[:, :2]
            along = (to * ray[:, :2]).sum(axis=1) / flat
            miss = (to**2).sum(axis=1) - along**2 * flat
            near = along - np.sqrt((radius**2 - miss) / flat)
            found = np.where((along > 0.0) & (near < found), near, found)
    if rng is not None:
        found = found + rng.normal(0.0, 0.018, BEAMS)
    return np.where(found < 30.0, found, np.inf).astype(np.float32)


def imu_message(time_ns, gyro, force):
    return Imu(
        header(time_ns, "uav1/imu"),
        Quaternion(0.0, 0.0, 0.0, 1.0),
        UNKNOWN,
        Vector3(*map(float, gyro)),
        UNKNOWN,
        Vector3(*map(float, force)),
        UNKNOWN,
    )


def scan_message(time_ns, ranges):
    last = FIRST + STEP * (BEAMS - 1)
    rest = (SWEEP_S / (BEAMS - 1), 0.025, 0.1, 60.0, ranges, np.zeros(0, np.float32))
    return LaserScan(header(time_ns, "uav1/laser"), FIRST, last, STEP, *rest)


def messages(flight, woods, seconds, biases=(0.0, 0.0), seed=0, noise=True):
    """(when they are received, topic, message), in order; IMU 200 Hz, scans 20 Hz."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(round(200 * seconds)):
        gyro, force = flight.imu(k / 200.0)
        if noise:
            gyro = gyro + rng.normal(0.0, 0.0048, 3)
            force = force + rng.normal(0.0, 0.057, 3)
        now = k * 5 * MS
        rows.append((now, 0, "imu", imu_message(now, gyro + biases[0], force + biases[1])))
        if k % 4 == 0:
            rows.append((now, 1, "joint_states", nod(now, *map(float, nod_angle(k / 200.0)))))
        if k % 20 == 0:
            height = flight.pose(k / 200.0)[0][2]
            rows.append((now, 2, "range", range_message(now, height if height > 0.3 else -np.inf)))
    for k in range(round(20 * seconds)):
        begin = k * 50 * MS
        arrival_ns = begin + 19 * MS
        for order, name, mount, nods in (
            (3, "horizontal", LEVEL, False),
            (4, "nodding", NODDING, True),
        ):
            ranges = cast(flight, woods, k / 20.0, mount, nods, rng if noise else None)
            rows.append((arrival_ns, order, f"laser/{name}/scan", scan_message(begin, ranges)))
    return [(when, topic, m) for when, _, topic, m in sorted(rows, key=lambda row: row[:2])]


def range_message(time_ns, distance):
    # radiation_type 0 is ultrasound
    return Range(header(time_ns, "uav1/range"), 0, 0.4, 0.2, 7.65, float(distance), 0.0)


def yaw_of(q):
    return float(rotations.yaw_of(np.array([q.x, q.y, q.z, q.w])))
