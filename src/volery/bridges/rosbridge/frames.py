"""The tree of frames that `/tf` and `/tf_static` define."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from volery.graph.messages import (
    Header,
    Quaternion,
    Time,
    Transform,
    TransformStamped,
    Vector3,
)

_LONGEST_CHAIN = 100
_MAX_FRAMES = 10_000
Numbers = tuple[float, ...]


class KnownFrames(NamedTuple):
    """Pose of a frame in another one: position (3,) m, quaternion x y z w, and its time."""

    position: Numbers
    rotation: Numbers
    stamp: Time

    def differs(self, other: KnownFrames, angle_rad: float, distance_m: float) -> bool:
        """Returns whether it has turned or moved by more than the limits."""
        cosine = abs(sum(a * b for a, b in zip(self.rotation, other.rotation, strict=True)))
        turned = 2.0 * math.acos(min(cosine, 1.0))
        return turned > angle_rad or math.dist(self.position, other.position) > distance_m

    def message(self, parent: str, child: str) -> TransformStamped:
        """Returns the pose of `child` in `parent`."""
        transform = Transform(Vector3(*self.position), Quaternion(*self.rotation))
        return TransformStamped(Header(self.stamp, parent), child, transform)

    def inverse(self) -> KnownFrames:
        """Returns the pose of the other frame in this one."""
        rotation = (*(-v for v in self.rotation[:3]), self.rotation[3])
        back = _rotated(rotation, self.position)
        return KnownFrames(tuple(-v for v in back), rotation, self.stamp)

    def times(self, inner: KnownFrames) -> KnownFrames:
        """Returns the pose in the outermost frame of a frame with the pose `inner` in this one."""
        moved = _rotated(self.rotation, inner.position)
        position = tuple(a + b for a, b in zip(self.position, moved, strict=True))
        stamp = max(self.stamp, inner.stamp, key=lambda time: (time.sec, time.nanosec))
        return KnownFrames(position, _product(self.rotation, inner.rotation), stamp)


class Frames:
    """The newest pose of each frame in its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, KnownFrames]] = {}

    def learn(self, transforms: Iterable[Any]) -> None:
        """Stores transforms; ignores those of frames beyond ten thousand."""
        for stamped in transforms:
            child = stamped.child_frame_id.lstrip("/")
            if child not in self._parents and len(self._parents) >= _MAX_FRAMES:
                continue
            move, turn = stamped.transform.translation, stamped.transform.rotation
            pose = KnownFrames(
                (move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w), stamped.header.stamp
            )
            self._parents[child] = (stamped.header.frame_id.lstrip("/"), pose)

    def pose(self, source: str, target: str) -> KnownFrames | None:
        """Returns the pose of `source` in `target`; None if the two are not connected."""
        ups, downs = self._to_root(source), self._to_root(target)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            return None
        return downs[common].inverse().times(ups[common])

    def _to_root(self, frame: str) -> dict[str, KnownFrames]:
        """Returns the pose of a frame in itself and in each of its ancestors, the nearest first."""
        pose = KnownFrames((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), Time(0, 0))
        found = {frame: pose}
        while len(found) < _LONGEST_CHAIN and frame in self._parents:
            frame, step = self._parents[frame]
            if frame in found:  # a cycle
                break
            pose = step.times(pose)
            found[frame] = pose
        return found


def _product(a: Numbers, b: Numbers) -> Numbers:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(rotation: Numbers, vector: Numbers) -> Numbers:
    x, y, z, w = rotation
    return _product(_product(rotation, (*vector, 0.0)), (-x, -y, -z, w))[:3]
