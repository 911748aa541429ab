"""Converts plain text logs of scanners, one scan per line, to messages."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.log_writer import LogWriter
from volery.bridges.logs.text_layout import PositionColumns, TextLayout
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import RecordingError
from volery.core.plurals import counted
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    LaserScan,
    Odometry,
    Published,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
    single,
)

_APART = re.compile(r"[\s,;]+")
_COMMENTS = ("#", "%", "//")
_LONGEST_LINE = 10_000_000
_LATEST_S = 4.0e9
"""Latest stamp of messages: 32 bits of seconds."""
_FEW = 0.01
"""Fraction of beams with a return below which units are wrong, or the scanner has no target in
range."""
_JUMP_NS = NS_PER_S // 2
"""Step back of the time from which on the clock was set; smaller steps are disorder."""


@dataclass
class TextScans:
    """A plain text log, to be iterated once.

    Iterating yields the `Published` messages of each line in turn: `/tf_static` with the mounting
    first, odometry if the log has it, the scan. An unreadable line is skipped and counted in
    `left_out`; `problem` describes the first one. If the clock was set back, the times go back,
    too; `clock_set` counts these steps. Raises `RecordingError` if the file cannot be read, or has
    no scan of this layout.
    """

    path: Path
    layout: TextLayout
    scans: int = 0
    left_out: int = 0
    clock_set: int = 0
    problem: str = ""
    _max_columns: int = field(default=0, repr=False)
    _met: int = field(default=0, repr=False)
    """Beams with a return within the scanner's range."""
    _unit_ns: Decimal = field(init=False, repr=False)
    """Unit of the times, ns."""
    _newest_ns: int = field(default=-1, repr=False)
    _counters: tuple[float, float] | None = field(default=None, repr=False)
    _pose: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), repr=False)
    """Pose from the wheels: x, y in m, yaw in rad."""

    def __post_init__(self) -> None:
        self._unit_ns = Decimal(repr(self.layout.time.unit_s)) * NS_PER_S

    def __iter__(self) -> Iterator[Published]:
        """Yields messages in the order of the lines."""
        try:
            with self.path.open(encoding="utf-8", errors="replace") as lines:
                number = 0
                while line := lines.readline(_LONGEST_LINE):
                    number += 1
                    if line.strip() and not line.lstrip().startswith(_COMMENTS):
                        yield from self._messages(number, line)
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read: {error.strerror}") from None
        if not self.scans:
            reason = self.problem or "it is empty"
            raise RecordingError(f"{self.path}: has no scan of this layout ({reason})")

    @property
    def warnings(self) -> list[str]:
        """Possible problems of the layout, a line each, after the log has been read."""
        it, warnings = self.layout.ranges, []
        unused = self._max_columns - self.layout.columns
        if unused > 0:
            warnings.append(
                f"{counted(unused, 'column')} unused: a line has {self._max_columns:,}, the "
                f"layout's last one is column {self.layout.columns - 1:,}, counted from 0"
            )
        fraction = self._met / max(self.scans * it.beams, 1)
        if fraction < _FEW:
            warnings.append(
                f"{'hardly any' if self._met else 'no'} range lies between {it.range_min_m:g} and "
                f"{it.range_max_m:g} m: is ranges.unit_m = {it.unit_m:g} right?"
            )
        return warnings

    def write_to(self, log: LogWriter) -> None:
        """Writes all messages to a log."""
        for published in self:
            log.write(published)

    def _messages(self, number: int, line: str) -> Iterator[Published]:
        try:
            words = _APART.split(line.strip(" \t\r\n,;"))
            row = self._numbers(words)
            time_ns = self._time_ns(words[self.layout.time.column])
        except ValueError as error:
            self.left_out += 1
            self.problem = self.problem or f"line {number}: {error}"
            return
        self.clock_set += time_ns < self._newest_ns
        self._newest_ns = time_ns
        uav = f"/{self.layout.uav}"
        if not self.scans:
            yield _published("/tf_static", time_ns, _mounting(self.layout, time_ns))
        self.scans += 1
        pose = self._pose_of(row)
        if pose is not None:
            yield _published(f"{uav}/odom", time_ns, _odometry(self.layout, time_ns, *pose))
        scan = _scan(self.layout, time_ns, row)
        self._met += int(np.count_nonzero(np.isfinite(scan.ranges)))
        yield _published(f"{uav}/{self.layout.topic}", time_ns, scan)

    def _numbers(self, words: list[str]) -> NDArray[np.float64]:
        self._max_columns = max(self._max_columns, len(words))
        if len(words) < self.layout.columns:
            found = counted(len(words), "column")
            raise ValueError(f"{found} where the layout needs {self.layout.columns}")
        try:
            row = np.array(words[: self.layout.columns], dtype=np.float64)
        except ValueError:
            raise ValueError("a column has no number") from None
        return row

    def _time_ns(self, word: str) -> int:
        """Returns the exact time of the text: a double of seconds would be off by 200 ns by now."""
        time_s = float(word) * self.layout.time.unit_s
        if not 0.0 <= time_s < _LATEST_S:  # which NaN is not
            raise ValueError(f"{time_s:g} s is out of range for a message's time")
        try:
            time_ns = int((Decimal(word) * self._unit_ns).to_integral_value())
        except ArithmeticError:
            raise ValueError(f"{word[:40]} is not an exact time") from None
        if self._newest_ns - _JUMP_NS <= time_ns <= self._newest_ns:
            raise ValueError(f"at {time_s:.6f} s, not after the line before it")
        return time_ns

    def _pose_of(self, row: NDArray[np.float64]) -> tuple[float, float, float] | None:
        """Returns the body's pose from the odometry's columns or the wheels.

        None if the line has neither.
        """
        odometry, wheels = self.layout.odometry, self.layout.wheels
        if odometry is not None:
            x, y, turn = (float(number) for number in row[list(odometry.columns)])
            unit = odometry.unit_m
            pose = (x * unit, y * unit, math.radians(turn * odometry.unit_deg))
            return pose if all(map(math.isfinite, pose)) else None
        if wheels is None:
            return None
        left, right = (float(number) * wheels.unit_m for number in row[list(wheels.columns)])
        if not math.isfinite(left + right):
            return None
        before, self._counters = self._counters or (left, right), (left, right)
        self._pose = _rolled(self._pose, left - before[0], right - before[1], wheels.apart_m)
        return self._pose


def _rolled(
    pose: tuple[float, float, float], left: float, right: float, apart: float
) -> tuple[float, float, float]:
    """Returns the pose after its wheels have rolled these distances, m, along an arc."""
    x, y, yaw = pose
    distance, turn = 0.5 * (left + right), (right - left) / apart
    along = yaw + 0.5 * turn
    return x + distance * math.cos(along), y + distance * math.sin(along), yaw + turn


def _published(topic: str, time_ns: int, message: Any) -> Published:
    return Published(topic, message.__msgtype__, time_ns, message)


def _scan(layout: TextLayout, time_ns: int, row: NDArray[np.float64]) -> LaserScan:
    """Converts a row to a LaserScan by REP 117: inf no return, -inf too near, NaN unmeasured."""
    it = layout.ranges
    raw = row[it.first_column : it.first_column + it.beams]
    ranges = raw * it.unit_m
    ranges[ranges < it.range_min_m] = -math.inf
    ranges[(ranges > it.range_max_m) | np.isin(raw, it.no_echo)] = math.inf
    low, high = math.radians(it.angle_min_deg), math.radians(it.angle_max_deg)
    values = ranges.astype(np.float32)
    values.flags.writeable = False
    return LaserScan(
        header(time_ns, _frame(layout)),
        single(low),
        single(high),
        single((high - low) / (it.beams - 1)),
        single(it.sweep_s / (it.beams - 1)),
        0.0,
        single(it.range_min_m),
        single(it.range_max_m),
        values,
        np.zeros(0, np.float32),
    )


def _odometry(layout: TextLayout, time_ns: int, x: float, y: float, yaw: float) -> Odometry:
    message: Odometry = zero_message("nav_msgs/msg/Odometry")
    message.header = header(time_ns, f"{layout.uav}/odom")
    message.child_frame_id = f"{layout.uav}/base_link"
    position, attitude = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y = x, y
    attitude.z, attitude.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def _mounting(layout: TextLayout, time_ns: int) -> TFMessage:
    stamped = header(time_ns, f"{layout.uav}/base_link")
    return TFMessage([TransformStamped(stamped, _frame(layout), _transform(layout.mount))])


def _transform(mount: PositionColumns) -> Transform:
    q = rotations.from_rpy(*(math.radians(angle) for angle in mount.rpy_deg))
    return Transform(Vector3(*mount.position_m), Quaternion(*(float(part) for part in q)))


def _frame(layout: TextLayout) -> str:
    """Returns the frame's name as in the simulation: `uav1/laser_horizontal`."""
    return f"{layout.uav}/{layout.topic.removesuffix('/scan').replace('/', '_')}"
