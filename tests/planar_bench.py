"""Rooms and corridors in the plane, a scanner that is carried through them, and its logs."""

from __future__ import annotations

import numpy as np

from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message

S = 1_000_000_000


def box(x0, y0, x1, y1):
    """Four walls."""
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return [(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]


def wall(x0, y0, x1, y1, *bridges):
    """A wall along x or y with gaps; each bridge is where it begins and ends along the wall."""
    across = abs(x1 - x0) > abs(y1 - y0)
    low, high = (x0, x1) if across else (y0, y1)
    marks = [low, *(edge for bridge in bridges for edge in bridge), high]
    pieces = zip(marks[::2], marks[1::2], strict=True)
    return [(a, y0, b, y0) if across else (x0, a, x0, b) for a, b in pieces]


def storey():
    """(W, 4) walls: a corridor 2 m wide around a block of rooms, 34 m x 20 m, and rooms outside."""
    walls = box(-1.0, -1.0, 35.0, 21.0)
    walls += wall(1.0, 1.0, 33.0, 1.0, (6.0, 7.0), (17.0, 18.2), (27.0, 28.0))
    walls += wall(1.0, 19.0, 33.0, 19.0, (4.0, 5.0), (22.0, 23.0))
    walls += wall(1.0, 1.0, 1.0, 19.0, (9.0, 10.0))
    walls += wall(33.0, 1.0, 33.0, 19.0, (5.0, 6.2), (13.0, 14.0))
    walls += wall(1.0, 10.0, 33.0, 10.0, (12.0, 13.0))
    walls += [(11.0, 1.0, 11.0, 10.0), (22.0, 1.0, 22.0, 19.0)]
    for x, y, side in ((4.0, 4.0, 1.2), (14.0, 3.0, 0.8), (29.0, 6.0, 1.5), (6.0, 14.0, 1.0),
                       (16.0, 16.0, 2.0), (27.0, 15.0, 0.6)):  # fmt: skip
        walls += box(x, y, x + side, y + 0.7 * side)
    for x in (3.0, 9.5, 14.0, 24.5, 31.0):  # pillars and niches along the corridor
        walls += box(x, -1.0, x + 0.4, -0.7)
        walls += box(x + 1.3, 20.6, x + 1.9, 21.0)
    return np.array(walls)


def corridor(length=60.0):
    """A plain one with some objects in its first metres, and a bridge near its end."""
    walls = box(-4.0, -1.0, length, 1.0)
    walls += box(-3.0, -1.0, -2.4, -0.5) + box(1.0, 0.6, 1.7, 1.0) + box(4.0, -1.0, 4.5, -0.7)
    walls += box(length - 10.0, 0.5, length - 9.3, 1.0)
    return np.array(walls)


ROUND = [(0.0, 0.0), (34.0, 0.0), (34.0, 20.0), (0.0, 20.0), (0.0, 0.0), (20.0, 0.0)]
"""Around the corridor, 108 m, and on: with the corners cut a little."""


def along(corners, speed=1.0, rate_hz=5.0, ease_m=1.2, start_s=1.0):
    """Times (N,) and poses (N, 3) of a scanner that looks ahead; it begins at rest."""
    corners = np.array(corners, float)
    steps = np.diff(corners, axis=0)
    lengths = np.hypot(*steps.T)
    total, marks = lengths.sum(), np.concatenate([[0.0], lengths.cumsum()])
    fine = np.linspace(0.0, total, int(total * 50))
    line = np.stack([np.interp(fine, marks, corners[:, k]) for k in range(2)], 1)
    half = int(ease_m * 50)
    kernel = np.hanning(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    padded = np.concatenate([
        line[0] - (line[1] - line[0]) * np.arange(half, 0, -1)[:, None], line,
        line[-1] + (line[-1] - line[-2]) * np.arange(1, half + 1)[:, None],
    ])  # fmt: skip
    smooth = np.stack([np.convolve(padded[:, k], kernel, "valid") for k in range(2)], 1)
    ahead = np.gradient(smooth, axis=0)
    yaw = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    arc_length = np.concatenate([[0.0], np.hypot(*np.diff(smooth, axis=0).T).cumsum()])
    time_s = np.arange(0.0, start_s + arc_length[-1] / speed + 1.0, 1.0 / rate_hz)
    gone = np.maximum(time_s - start_s, 0.0)
    gone = speed * np.where(gone < 1.0, 0.5 * gone**2, gone - 0.5)
    gone = np.minimum(gone, arc_length[-1])
    poses = [np.interp(gone, arc_length, column) for column in (*smooth.T, yaw)]
    return time_s, np.stack(poses, 1)


def cast(walls, pose, angles):
    """Ranges (B,) of beams at `angles` (B,) from a pose (3,); inf: nothing is met."""
    c, s = np.cos(pose[2] + angles), np.sin(pose[2] + angles)
    ax, ay = walls[:, 0] - pose[0], walls[:, 1] - pose[1]
    dx, dy = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = c[:, None] * dy - s[:, None] * dx
        away = (ax * dy - ay * dx) / cross
        along_wall = (ax * s[:, None] - ay * c[:, None]) / cross
        met = (away > 1e-6) & (along_wall >= 0.0) & (along_wall <= 1.0)
    return np.where(met, away, np.inf).min(axis=1)


class Carried:
    """A scanner along a path: `time_s` (N,), `poses` (N, 3), `ranges` (N, B)."""

    def __init__(self, walls, corners, *, beams=361, fov_deg=270.0, max_range_m=20.0, noise=0.015,
                 seed=1, speed=1.0, rate_hz=5.0):  # fmt: skip
        rng = np.random.default_rng(seed)
        self.angles = np.radians(np.linspace(-0.5 * fov_deg, 0.5 * fov_deg, beams))
        self.max_range_m, self.walls = max_range_m, walls
        self.time_s, self.poses = along(corners, speed=speed, rate_hz=rate_hz)
        rows = [cast(walls, pose, self.angles) for pose in self.poses]
        self.ranges = np.array(rows) + rng.normal(0.0, noise, (len(rows), beams))
        self.ranges[self.ranges > max_range_m] = np.inf
        self.odometry = self._drifting(rng)

    def _drifting(self, rng):
        """Wheels that slip by 2 % and turn 3 % too far."""
        poses = [np.zeros(3)]
        for one, other in zip(self.poses, self.poses[1:], strict=False):
            c, s = np.cos(one[2]), np.sin(one[2])
            dx, dy = other[:2] - one[:2]
            step = np.array([c * dx + s * dy, c * dy - s * dx, other[2] - one[2]])
            moved = np.hypot(*step[:2])
            step = step * [1.02, 1.0, 1.03] + rng.normal(0.0, 1.0, 3) * [
                0.02 * moved, 0.005 * moved, 0.01 * moved + 0.02 * abs(step[2])]  # fmt: skip
            x, y, yaw = poses[-1]
            c, s = np.cos(yaw), np.sin(yaw)
            poses.append(
                np.array([x + c * step[0] - s * step[1], y + s * step[0] + c * step[1],
                          yaw + step[2]])
            )  # fmt: skip
        return np.array(poses)

    def scan(self, row):
        """The message."""
        return scan_message(
            round(self.time_s[row] * S), self.ranges[row], self.angles, self.max_range_m
        )

    def odometry_message(self, row):
        return odometry_message(round(self.time_s[row] * S), self.odometry[row])

    def text(self, *, with_odometry=True):
        """Lines of a log: µs, x, y in mm and yaw in mdeg, ranges in mm."""
        for k, when in enumerate(self.time_s):
            x, y, yaw = self.odometry[k]
            moving = [f"{x * 1e3:.1f}", f"{y * 1e3:.1f}", f"{np.degrees(yaw) * 1e3:.0f}"]
            seen = ["0" if np.isinf(r) else f"{r * 1e3:.0f}" for r in self.ranges[k]]
            yield " ".join([f"{when * 1e6:.0f}", *(moving if with_odometry else []), *seen])

    def layout(self, *, with_odometry=True):
        """The TOML file for `text`."""
        low, high = np.degrees(self.angles[[0, -1]])
        moving = "[odometry]\ncolumns = [1, 2, 3]\nunit_deg = 0.001\n" if with_odometry else ""
        return (
            f"[ranges]\nfirst_column = {4 if with_odometry else 1}\nbeams = {len(self.angles)}\n"
            f"angle_min_deg = {low}\nangle_max_deg = {high}\nrange_max_m = {self.max_range_m}\n"
            f"{moving}"
        )


def scan_message(time_ns, ranges, angles, max_range_m):
    message = zero_message("sensor_msgs/msg/LaserScan")
    message.header = m.header(time_ns, "uav1/laser_horizontal")
    message.angle_min, message.angle_max = float(angles[0]), float(angles[-1])
    message.angle_increment = float(angles[1] - angles[0])
    message.range_min, message.range_max = 0.05, max_range_m
    message.ranges = np.asarray(ranges, np.float32)
    return message


def odometry_message(time_ns, pose):
    message = zero_message("nav_msgs/msg/Odometry")
    message.header = m.header(time_ns, "uav1/odom")
    turn = m.Quaternion(0.0, 0.0, float(np.sin(0.5 * pose[2])), float(np.cos(0.5 * pose[2])))
    message.pose.pose = m.Pose(m.Point(float(pose[0]), float(pose[1]), 0.0), turn)
    return message
