"""Builds transforms for `/tf`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
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
from volery.publishing.transform_template import TransformTemplate

_MANY = 32
"""Number of transforms from which on a template is worth its memory."""


def transforms_in_map(time_ns: int, frames: Sequence[str], poses: Array) -> TFMessage:
    """Returns the transforms from `map` to `frames`; poses (N, 7) are x y z qx qy qz qw, m.

    Transforms are built at each access, and CDR of many is written from the array. The arguments
    must not change afterwards.
    """
    parents = ["map"] * len(frames)
    return _message(time_ns, parents, frames, poses, _build(time_ns, parents, frames, poses))


def transforms_of_odometry(time_ns: int, uav_names: Sequence[str], poses: Array) -> TFMessage:
    """Returns the transforms from `uavN/odom` to `uavN/base_link`, as `transforms_in_map`.

    They are built once, at the first access, because many nodes of a team read each message.
    """
    parents = [f"{name}/odom" for name in uav_names]
    frames = [f"{name}/base_link" for name in uav_names]
    build = cache(_build(time_ns, parents, frames, poses))
    return _message(time_ns, parents, frames, poses, build)


_Build = Callable[[], list[TransformStamped]]


def _build(time_ns: int, parents: Sequence[str], frames: Sequence[str], poses: Array) -> _Build:
    def build() -> list[TransformStamped]:
        headers = {parent: header(time_ns, parent) for parent in set(parents)}
        return [
            TransformStamped(headers[parent], frame, Transform(Vector3(x, y, z), Quaternion(*turn)))
            for parent, frame, (x, y, z, *turn) in zip(parents, frames, poses.tolist(), strict=True)
        ]

    return build


def _message(
    time_ns: int, parents: Sequence[str], frames: Sequence[str], poses: Array, build: _Build
) -> TFMessage:
    def cdr() -> bytes:
        return _template(tuple(parents), tuple(frames)).filled(time_ns, poses)

    transforms: Any = LazyList(len(frames), build, cdr if len(frames) >= _MANY else None)
    return TFMessage(transforms)


@lru_cache(maxsize=4)
def _template(parents: tuple[str, ...], frames: tuple[str, ...]) -> TransformTemplate:
    return TransformTemplate(parents, frames)
