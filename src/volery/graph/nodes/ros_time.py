"""Provides the classes of `rclpy.time`, `rclpy.duration` and `rclpy.clock`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import total_ordering
from typing import Any

from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
from volery.graph.messages import Time as TimeMessage
from volery.graph.messages import message_type

_LONGEST_NS = 2**63


class ClockType(IntEnum):
    """Kind of a clock."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


@total_ordering
class Duration:
    """A duration, which may be negative."""

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        self._ns = int(seconds * NS_PER_S) + int(nanoseconds)
        if not -_LONGEST_NS <= self._ns < _LONGEST_NS:
            raise OverflowError("a duration must fit in 64 bits of nanoseconds")

    @property
    def nanoseconds(self) -> int:
        """Length, ns."""
        return self._ns

    def to_msg(self) -> Any:
        """Returns a `builtin_interfaces/msg/Duration`."""
        return message_type("builtin_interfaces/msg/Duration")(*divmod(self._ns, NS_PER_S))

    @classmethod
    def from_msg(cls, msg: Any) -> Duration:
        """Returns the duration in a message."""
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec)

    def __eq__(self, other: object) -> bool:
        return self._ns == other._ns if isinstance(other, Duration) else NotImplemented

    def __lt__(self, other: Duration) -> bool:
        return self._ns < other._ns if isinstance(other, Duration) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._ns)

    def __add__(self, other: Duration) -> Duration:
        if not isinstance(other, Duration):
            return NotImplemented
        return Duration(nanoseconds=self._ns + other._ns)

    def __sub__(self, other: Duration) -> Duration:
        if not isinstance(other, Duration):
            return NotImplemented
        return Duration(nanoseconds=self._ns - other._ns)

    def __mul__(self, factor: float) -> Duration:
        if not isinstance(factor, int | float):
            return NotImplemented
        if math.isnan(factor):
            raise ValueError("a duration times nan")
        return INFINITE if math.isinf(factor) else Duration(nanoseconds=int(self._ns * factor))

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._ns})"

    def __str__(self) -> str:
        return "Infinite" if self == INFINITE else f"{self._ns} nanoseconds"


INFINITE = Duration(nanoseconds=_LONGEST_NS - 1)
"""rclpy's `Infinite`."""


class Time:
    """An instant of a clock, ns since its start."""

    def __init__(
        self,
        *,
        seconds: float = 0,
        nanoseconds: int = 0,
        clock_type: ClockType = ClockType.SYSTEM_TIME,
    ) -> None:
        if seconds < 0 or nanoseconds < 0:
            raise ValueError("a time must not be negative")
        self._ns = int(seconds * NS_PER_S) + int(nanoseconds)
        if self._ns >= _LONGEST_NS:
            raise OverflowError("a time must fit in 63 bits of nanoseconds")
        self._clock_type = clock_type

    @property
    def nanoseconds(self) -> int:
        """Nanoseconds since the clock's start."""
        return self._ns

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Returns whole seconds and the remainder in ns."""
        return divmod(self._ns, NS_PER_S)

    @property
    def clock_type(self) -> ClockType:
        """Kind of the clock."""
        return self._clock_type

    def to_msg(self) -> TimeMessage:
        """Returns a `builtin_interfaces/msg/Time`."""
        return TimeMessage(*divmod(self._ns, NS_PER_S))

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> Time:
        """Returns the time in a message, such as a header's stamp."""
        return cls(seconds=msg.sec, nanoseconds=msg.nanosec, clock_type=clock_type)

    def __add__(self, other: Duration) -> Time:
        if not isinstance(other, Duration):
            return NotImplemented
        return Time(nanoseconds=self._ns + other.nanoseconds, clock_type=self._clock_type)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        """Returns the duration since another time of the same clock, or an earlier time."""
        if isinstance(other, Time):
            return Duration(nanoseconds=self._ns - self._comparable(other))
        if isinstance(other, Duration):
            return Time(nanoseconds=self._ns - other.nanoseconds, clock_type=self._clock_type)
        return NotImplemented

    def _comparable(self, other: Time) -> int:
        if self._clock_type != other.clock_type:
            raise TypeError(
                f"times of different clocks: {self._clock_type.name} and {other.clock_type.name}"
            )
        return other.nanoseconds

    def __eq__(self, other: object) -> bool:
        return self._ns == self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __lt__(self, other: Time) -> bool:
        return self._ns < self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __le__(self, other: Time) -> bool:
        return self._ns <= self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __gt__(self, other: Time) -> bool:
        return self._ns > self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __ge__(self, other: Time) -> bool:
        return self._ns >= self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __hash__(self) -> int:
        return hash((self._ns, self._clock_type))

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self._ns}, clock_type={self._clock_type.name})"


class Clock:
    """A node's clock: simulated time in a simulation or where the graph has a `/clock`.

    Made without a node, as `Clock()`, it has the time of the computer, as in rclpy.
    """

    def __init__(
        self, now_ns: Callable[[], int] | None = None, *, clock_type: ClockType | None = None
    ) -> None:
        self._of_node = now_ns is not None
        if clock_type is None:
            clock_type = ClockType.SYSTEM_TIME if now_ns is None else ClockType.ROS_TIME
        if now_ns is None:
            is_steady = clock_type == ClockType.STEADY_TIME
            now_ns = time.monotonic_ns if is_steady else time.time_ns
        self._now_ns = now_ns
        self._clock_type = clock_type

    @property
    def clock_type(self) -> ClockType:
        """ROS_TIME for a node's clock."""
        return self._clock_type

    def now(self) -> Time:
        """Returns the current time."""
        return Time(nanoseconds=self._now_ns(), clock_type=self._clock_type)

    def now_ns(self) -> int:
        """Returns the current time, ns since the start of the run."""
        return self._now_ns()

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clock has simulated time: that of a node."""
        return self._of_node

    def create_jump_callback(self, *_arguments: Any, **_options: Any) -> JumpHandle:
        """Returns a handle; a clock does not jump, because a reset creates nodes again."""
        return JumpHandle()

    def sleep_until(self, *_arguments: Any, **_options: Any) -> bool:
        """Raises `GraphError`: no callback can wait."""
        raise GraphError(
            "a clock waits, and simulated time stands still in a callback: use a timer"
        )

    sleep_for = sleep_until


class ROSClock(Clock):
    """`rclpy.clock.ROSClock`, which belongs to no node."""

    def __init__(self) -> None:
        super().__init__(clock_type=ClockType.ROS_TIME)


class ClockChange(IntEnum):
    """Why a clock jumps."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4


@dataclass
class JumpThreshold:
    """Jumps of a clock that a callback is interested in."""

    min_forward: Duration | None
    min_backward: Duration | None
    on_clock_change: bool = True


class JumpHandle:
    """A callback of `Clock.create_jump_callback`; none is ever called."""

    def unregister(self) -> None:
        """Does nothing."""
