"""Receives the courses that policies fly: a trajectory to follow, gates to fly through."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from volery.autonomy.perception.map_frame import MAP, MapFrame
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.planning.trajectory_messages import TrajectorySamples, samples_of
from volery.autonomy.policy.gate_terms import in_gates, passes
from volery.autonomy.policy.node_inputs import NodeInput, usable_pose
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import ns_from_s
from volery.core.errors import NodeError
from volery.graph.messages import (
    MultiDOFJointTrajectory,
    Odometry,
    PathMessage,
    Pose,
    TFMessage,
    frame_of,
)
from volery.graph.nodes.node import Node

_MAX_DISTANCE_M = 1e6
_MAX_GATES = 1000


class TrajectoryInput(NodeInput):
    """The last trajectory on `~/trajectory`, in the map; its start is the message's stamp."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "_samples")
    what = "trajectory"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self._samples: TrajectorySamples | None = None
        node.create_subscription(MultiDOFJointTrajectory, "~/trajectory", self._on_message, 1)

    def fault(self, now_ns: int) -> str:
        """Returns why there is no point to fly to at present; see `NodeInput.fault`."""
        fault = super().fault(now_ns)
        if fault or self._samples is None:
            return fault
        first, last = self._samples.time_ns[[0, -1]].tolist()
        if now_ns < first:
            return "the trajectory has not begun"
        return "the trajectory has ended" if now_ns > last else ""

    def points(self, ahead_s: Sequence[float]) -> Array:
        """Returns the points (T, 3), m, map, at times (T,), s, after now; at the end the last."""
        assert self._samples is not None
        now_ns = self._node.get_clock().now_ns()
        return np.stack([_point(self._samples, now_ns + ns_from_s(time)) for time in ahead_s])

    def _on_message(self, message: MultiDOFJointTrajectory) -> None:
        samples, frame = samples_of(message), frame_of(message)
        if frame not in ("", MAP):
            self._refuse(f"must be in '{MAP}', not in '{frame[:80]}'")
        elif samples is None or float(np.abs(samples.position).max()) > _MAX_DISTANCE_M:
            self._refuse("needs points with finite positions and velocities at increasing times")
        else:
            self._samples = samples
            self._accept()


class GatesInput(NodeInput):
    """Gates to fly through in order: the parameter `gates`, or the poses of a path on `~/gates`.

    Gates are [x, y, z, yaw]. The last pose is no gate, but a point to head for behind the last
    one. A gate is passed where the odometry crosses its opening, `gate_opening_m` wide.
    """

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "gates", "_next", "_last")
    what = "gates"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self.gates: Array = np.zeros((0, 4))
        """(G, 4) m and rad, map."""
        self._next = 0
        self._last: Array | None = None
        """Position at the last odometry."""
        value = node.declare_parameter("gates", []).value
        opening = node.declare_parameter("gate_opening_m", 1.6, min_value=0.05, max_value=1e3)
        self._room = 0.5 * float(opening.value)
        if len(value):
            self._start(_gates_of(value))
        self._frame = MapFrame()
        odometry = str(node.get_parameter("odometry").value)
        node.create_subscription(Odometry, odometry, self._on_odometry, 5)
        if node.get_parameter("use_map_tf").value:
            node.create_subscription(TFMessage, "/tf", self._frame.on_tf, 50)
        node.create_subscription(PathMessage, "~/gates", self._on_path, 1)

    def ahead(self, count: int) -> Array:
        """Returns the next gates (count, 4); behind the last one that one again."""
        return self.gates[np.minimum(self._next + np.arange(count), len(self.gates) - 1)]

    def _start(self, gates: Array) -> None:
        self.gates, self._next, self._last = gates, 0, None
        self._accept()

    def _on_path(self, path: PathMessage) -> None:
        frame, gates = frame_of(path), np.array([_gate_of(p.pose) for p in path.poses])
        if frame not in ("", MAP):
            self._refuse(f"must be in '{MAP}', not in '{frame[:80]}'")
        elif not 0 < len(gates) <= _MAX_GATES or not _are_possible(gates):
            self._refuse("are not finite, too many, or none")
        else:
            self._start(gates)

    def _on_odometry(self, message: Odometry) -> None:
        pose, _ = usable_pose(self._frame.pose_in_map(message))
        if pose is not None and len(self.gates):
            self._pass(pose)

    def _pass(self, pose: OdometrySample) -> None:
        if self._last is not None and self._next < len(self.gates) - 1:
            gate = self.gates[self._next : self._next + 1]
            segment = in_gates(np.stack([self._last, pose.position]), gate)[:, 0]
            self._next += int(passes(segment[0], segment[1], self._room))
        self._last = pose.position


def _point(samples: TrajectorySamples, time_ns: int) -> Array:
    """Returns the position (3,) at a time, linear between samples."""
    row = bisect_left(samples.time_ns, time_ns, 1, len(samples.time_ns))
    if row == len(samples.time_ns):
        return np.asarray(samples.position[-1])
    first, last = samples.time_ns[row - 1 : row + 1].tolist()
    fraction = max(time_ns - first, 0) / (last - first)
    return np.asarray(
        samples.position[row - 1] * (1.0 - fraction) + samples.position[row] * fraction
    )


def _gates_of(value: object) -> Array:
    try:
        gates = np.asarray(value, np.float64).reshape(-1, 4)
    except (TypeError, ValueError):
        gates = np.full((1, 4), np.nan)
    if not _are_possible(gates):
        raise NodeError(f"gates must be a list of [x, y, z, yaw], m and rad, not {value!r}")
    return gates


def _gate_of(pose: Pose) -> list[float]:
    p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, rotations.heading_of((q.x, q.y, q.z, q.w)) or 0.0]


def _are_possible(gates: Array) -> bool:
    return bool(np.isfinite(gates).all()) and float(np.abs(gates).max()) <= _MAX_DISTANCE_M
