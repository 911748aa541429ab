"""Trunk detection from one UAV's own sensors and its estimated trajectory.

Scans of the level LIDAR contain trunks at flight height, but also crowns of saplings, and the
ground where it rises or the UAV tilts. The nodding LIDAR distinguishes them: see
`autonomy.mapping.vertical_structures`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.vertical_structures import VerticalStructures
from volery.autonomy.perception.static_transforms import Mount, StaticTransforms
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.graph.messages import stamp_of
from volery.report.trajectories import RecordedTrajectory
from volery.report.trunks import TrunkMap, trunks_of_scan

LEVEL, NODDING = "laser/horizontal/scan", "laser/nodding/scan"
_JOINT = "laser_nodding"
_LEVEL_NS, _NODDING_NS = 500_000_000, 75_000_000
"""Every third of 40 nodding scans a second, so that a period of a second does not repeat angles."""
_NEAREST_M, _MAX_RANGE_M = 0.6, 20.0


class TrunkSurvey:
    """Collects a UAV's messages, and builds a trunk map once its trajectory is known."""

    def __init__(self, joints: StaticTransforms | None = None) -> None:
        self._seen: list[tuple[str, float, float, Array]] = []
        """Frame, time of the first beam and between beams, s, trunks (K, 3)."""
        self._nodding: list[tuple[str, float, Array, NDArray[np.float32]]] = []
        """Frame, time of the first beam, s; angle of the first beam, between beams, and time
        between them (3,); ranges.
        """
        self._nods: list[tuple[float, float]] = []
        self._next_ns = {LEVEL: 0, NODDING: 0}
        self.joints = joints or StaticTransforms()
        """Mounts of its LIDARs."""

    @property
    def is_founded(self) -> bool:
        """Whether nodding scans can confirm that trunks reach the ground."""
        return bool(self._nodding and self._nods)

    def wants(self, scan: str, time_ns: int) -> bool:
        """Returns whether a scan, `LEVEL` or `NODDING`, is due at a time."""
        return time_ns >= self._next_ns[scan]

    def add_nods(self, message: Any) -> None:
        """Adds a message of joint_states."""
        if _JOINT in message.name:
            angle = float(message.position[list(message.name).index(_JOINT)])
            self._nods.append((stamp_of(message) / NS_PER_S, angle))

    def add_scan(self, scan: str, time_ns: int, message: Any) -> None:
        """Adds a scan of the level or the nodding LIDAR, if it is due."""
        if not self.wants(scan, time_ns):
            return
        period = _LEVEL_NS if scan == LEVEL else _NODDING_NS
        self._next_ns[scan] = time_ns - time_ns % period + period
        frame, first = message.header.frame_id, (stamp_of(message) or time_ns) / NS_PER_S
        angles = float(message.angle_min), float(message.angle_increment)
        if scan == LEVEL:
            seen = trunks_of_scan(message.ranges, *angles)
            self._seen.append((frame, first, float(message.time_increment), seen))
        else:
            beams = np.array([*angles, float(message.time_increment)])
            self._nodding.append((frame, first, beams, np.array(message.ranges, np.float32)))

    def trunks(self, trajectory: RecordedTrajectory) -> TrunkMap:
        """Returns the map of trunks for an estimated trajectory."""
        columns = VerticalStructures(self._returns(trajectory)) if self.is_founded else None
        found = TrunkMap()
        for frame, first, step, seen in self._seen:
            mount = self.joints.mount_of(frame)
            placed = [_placed(trunk, first + step * trunk[2], mount, trajectory) for trunk in seen]
            kept = [p for p in placed if p is not None and (columns is None or columns.stands(p))]
            found.add(np.array(kept).reshape(-1, 3))
        return found

    def _returns(self, trajectory: RecordedTrajectory) -> Array:
        """Returns the returns (N, 3) of the nodding LIDAR in the map."""
        nods = np.array(sorted(self._nods)).T
        found = [np.zeros((0, 3))]
        for frame, first, (angle, turn, step), ranges in self._nodding:
            beams = np.flatnonzero((ranges > _NEAREST_M) & (ranges < _MAX_RANGE_M))
            before, after = (
                trajectory.pose_at(first),
                trajectory.pose_at(first + step * len(ranges)),
            )
            if before is None or after is None or not len(beams):
                continue
            nod = np.interp(first + step * beams, *nods)
            x, y = (ranges[beams] * f(angle + turn * beams) for f in (np.cos, np.sin))
            mount = self.joints.mount_of(frame)
            along = np.stack([np.cos(nod) * x, y, -np.sin(nod) * x], axis=1)
            body = rotations.rotate(mount.attitude, along) + mount.position
            one, other = (rotations.rotate(turned, body) + p for p, turned in (before, after))
            found.append(one + (beams / len(ranges))[:, None] * (other - one))
        return np.concatenate(found)


def _placed(
    trunk: Array, seconds: float, mount: Mount, trajectory: RecordedTrajectory
) -> Array | None:
    """Returns the map position (3,) of a trunk in a level scan; None if the pose is unknown."""
    pose = trajectory.pose_at(seconds)
    if pose is None:
        return None
    flat = np.array([trunk[0], trunk[1], 0.0])
    body = rotations.rotate(mount.attitude, flat) + mount.position
    return np.asarray(rotations.rotate(pose[1], body) + pose[0])
