"""Builds transforms for `/tf`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from volery.core.arrays import Array
from volery.graph.lazy_list import LazyList
from volery.graph.messages import (
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
)


def transforms_in_map(time_ns: int, frames: Sequence[str], poses: Array) -> TFMessage:
    """Returns the transforms from `map` to `frames`; poses (N, 7) are x y z qx qy qz qw, m.

    Each transform is built when it is read. The arguments must not change afterwards.
    """
    stamp = header(time_ns, "map")

    def build() -> list[TransformStamped]:
        return [
            TransformStamped(stamp, frame, Transform(Vector3(x, y, z), Quaternion(*turn)))
            for frame, (x, y, z, *turn) in zip(frames, poses.tolist(), strict=True)
        ]

    transforms: Any = LazyList(len(frames), build)
    return TFMessage(transforms)
