"""Filters entities by names, categories, tags and bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import PatternError
from volery.core.patterns import posix_search
from volery.runtime.services.results import RefusedError, ResultCode


class Category(IntEnum):
    """Enumerates `simulation_interfaces/msg/EntityCategory`."""

    OBJECT = 0
    ROBOT = 1
    HUMAN = 2
    DYNAMIC_OBJECT = 4
    STATIC_OBJECT = 5


class BoundsType(IntEnum):
    """Enumerates `simulation_interfaces/msg/Bounds`."""

    EMPTY = 0
    BOX = 1
    CONVEX_HULL = 2
    SPHERE = 3


def name_filter(pattern: str) -> Callable[[str], bool]:
    """Returns whether a name contains a match of a POSIX extended regular expression.

    An empty pattern matches all. Raises `RefusedError` if the expression is invalid.
    """
    if not pattern:
        return lambda _name: True
    try:
        return posix_search(pattern)
    except PatternError as error:
        raise RefusedError(ResultCode.OPERATION_FAILED, f"filter: {error}") from None


def tag_filter(tags: Any) -> Callable[[Sequence[str]], bool]:
    """Returns whether tags pass a `TagsFilter`: any (0) or all (1) of the filter's tags."""
    wanted = set(tags.tags)
    if not wanted:
        return lambda _own: True
    if tags.filter_mode not in (0, 1):
        reason = f"filter_mode is 0 (any) or 1 (all), not {tags.filter_mode}"
        raise RefusedError(ResultCode.OPERATION_FAILED, reason)
    if tags.filter_mode == 1:
        return lambda own: wanted <= set(own)
    return lambda own: bool(wanted & set(own))


def bounds_filter(bounds: Any) -> Callable[[Array, float], bool]:
    """Returns whether a ball (position (3,), m, map; radius, m) intersects `Bounds`.

    Empty bounds contain all. Raises `RefusedError` for convex hulls and invalid bounds.
    """
    kind = int(bounds.type)
    points = np.array([[p.x, p.y, p.z] for p in bounds.points], dtype=np.float64).reshape(-1, 3)
    if kind == BoundsType.EMPTY:
        return lambda _position, _radius: True
    if kind == BoundsType.CONVEX_HULL:
        raise RefusedError(
            ResultCode.FEATURE_UNSUPPORTED, "convex hulls are not supported; use box or sphere"
        )
    if kind not in (BoundsType.BOX, BoundsType.SPHERE):
        raise RefusedError(ResultCode.OPERATION_FAILED, f"there are no bounds of type {kind}")
    if len(points) != 2 or not np.isfinite(points).all():
        raise RefusedError(ResultCode.OPERATION_FAILED, "bounds need two finite points")
    if kind == BoundsType.SPHERE:
        center, sphere_radius = points[0], float(points[1, 0])
        if sphere_radius < 0.0:
            raise RefusedError(
                ResultCode.OPERATION_FAILED, "the radius of a sphere must not be negative"
            )
        return lambda position, radius: _distance(position, center) <= sphere_radius + radius
    low, high = points.min(axis=0), points.max(axis=0)
    return lambda position, radius: _distance(position, np.clip(position, low, high)) <= radius


def _distance(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))
