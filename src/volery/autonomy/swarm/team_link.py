"""A node's link to the UAVs of a team: their odometry, and their velocity commands.

Any client can publish on a UAV's topics. `TeamLink` refuses odometry that the UAV can hardly have
sent; what is plausible, it takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import PlanError
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import Odometry, Twist, Vector3
from volery.graph.nodes.node import Node

_SILENCE_S = 1.0
"""Time without odometry after which a UAV is lost."""
_LOW = 0.4
"""Part of the flight height below which a UAV is lost, or still climbs."""
_CLIMB_GAIN, _MAX_CLIMB_M_S = 1.2, 1.0
_STILL_M_S = 0.2
_SENSIBLE = 1e6
"""Odometry with a larger number, m or m/s, or with NaN, is refused."""
_FASTEST_M_S, _NOISE_M = 25.0, 1.0
"""A position farther from the last one than the UAV flies at this speed, plus noise, is a jump."""
_JUMP_REFUSAL_S = 0.5
"""Time for which jumps are refused after the last plausible position: a UAV that was displaced
sends no other positions, one whose messages are forged sends true ones in between."""


def number(node: Node, name: str, default: float, minimum: float, maximum: float) -> float:
    """Declares a parameter that is a number within limits; returns its value."""
    parameter = node.declare_parameter(name, default, min_value=minimum, max_value=maximum)
    return float(parameter.value)


def limited(velocity: Array, speed: float) -> Array:
    """Returns a velocity (2,) of at most a speed."""
    return velocity * min(1.0, speed / max(float(np.hypot(*velocity)), 1e-9))


class TeamLink(SavedAttributes):
    """Connects a node with N UAVs; a part of its state.

    odometry: name of the topic below the UAVs' namespaces; height_m: of the flight, in the map;
    is_commanded: whether the node commands the UAVs, or only follows their motion. Raises
    `PlanError` for names that are not unique, and for none to command.
    """

    STATE = ("_samples", "_taken_ns", "members", "num_refused")

    def __init__(
        self,
        node: Node,
        names: Sequence[str],
        odometry: str,
        height_m: float,
        *,
        is_commanded: bool = True,
    ) -> None:
        self.names = tuple(names)
        if (is_commanded and not names) or len(set(names)) < len(names):
            raise PlanError("a team must name at least one UAV, each once")
        self.members = list(range(len(self.names)))
        """Rows of the UAVs that are not lost."""
        self.num_refused = 0
        """Number of odometry messages that were refused."""
        self._clock = node.get_clock()
        self._low_m = _LOW * height_m
        self._samples: list[OdometrySample | None] = [None] * len(self.names)
        self._taken_ns = [0] * len(self.names)
        """Times at which the samples arrived, ns."""
        for row, name in enumerate(self.names):
            node.create_subscription(Odometry, f"/{name}/{odometry}", self._listener(row), 1)
        commanded = self.names if is_commanded else ()
        self._commands = [node.create_publisher(Twist, f"/{n}/cmd_vel", 1) for n in commanded]

    def _listener(self, row: int) -> Callable[[Any], None]:
        def on_odometry(message: Any) -> None:
            sample, now_ns = OdometrySample.from_odometry(message), self._clock.now_ns()
            if self._is_plausible(row, sample, now_ns):
                self._samples[row], self._taken_ns[row] = sample, now_ns
            else:
                self.num_refused += 1

        return on_odometry

    def _is_plausible(self, row: int, sample: OdometrySample, now_ns: int) -> bool:
        """Returns whether UAV `row` can have sent a sample that arrives now.

        Times are those of arrival, because a forged stamp is as easy to send as a position.
        """
        numbers = [*sample.position, *sample.velocity, *sample.attitude]
        if not np.abs(numbers).max() < _SENSIBLE:
            return False
        if abs(now_ns - sample.time_ns) > _SILENCE_S * NS_PER_S:
            return False
        last, passed_s = self._samples[row], (now_ns - self._taken_ns[row]) / NS_PER_S
        if (
            last is None or not 0.0 <= passed_s < _JUMP_REFUSAL_S
        ):  # negative: the clock was set back
            return True
        moved_m = float(np.linalg.norm(sample.position - last.position))
        return moved_m < _NOISE_M + _FASTEST_M_S * passed_s

    def sample(self, row: int) -> OdometrySample | None:
        """Returns the last odometry of a UAV; None before the first."""
        return self._samples[row]

    def is_up(self) -> bool:
        """Returns whether all UAVs are in the air and none climbs."""
        return all(
            sample is not None
            and sample.position[2] > self._low_m
            and abs(sample.velocity[2]) < _STILL_M_S
            for sample in self._samples
        )

    def drop_lost(self, now_ns: int) -> list[str]:
        """Removes silent and low UAVs from the members; returns their names."""
        present = self.present(now_ns)
        lost = [row for row in self.members if row not in present]
        self.members = [row for row in self.members if row not in lost]
        return [self.names[row] for row in lost]

    def present(self, now_ns: int) -> dict[int, OdometrySample]:
        """Returns the last odometry of the UAVs that are neither silent nor low, by row."""
        return {
            row: sample
            for row, sample in enumerate(self._samples)
            if sample is not None
            and now_ns - sample.time_ns <= _SILENCE_S * NS_PER_S
            and sample.position[2] > self._low_m
        }

    def motion(self) -> tuple[Array, Array]:
        """Returns positions (M, 2) m and velocities (M, 2) m/s of the members; all have one."""
        samples = [sample for row in self.members if (sample := self._samples[row]) is not None]
        position = np.array([sample.position[:2] for sample in samples]).reshape(-1, 2)
        velocity = np.array([sample.velocity[:2] for sample in samples]).reshape(-1, 2)
        return position, velocity

    def command(self, row: int, level: Array, height_m: float) -> None:
        """Commands a UAV a horizontal velocity (2,) m/s in the map, at a height."""
        sample = self._samples[row]
        if sample is None:
            return
        climb = _CLIMB_GAIN * (height_m - float(sample.position[2]))
        c, s = math.cos(sample.yaw), math.sin(sample.yaw)
        forward, left = c * level[0] + s * level[1], c * level[1] - s * level[0]
        up = max(-_MAX_CLIMB_M_S, min(_MAX_CLIMB_M_S, climb))
        linear = Vector3(float(forward), float(left), float(up))
        self._commands[row].publish(Twist(linear, Vector3(0.0, 0.0, 0.0)))
