"""Node parameters that are lists of numbers: poses, mounts of sensors."""

from __future__ import annotations

import math
from typing import Any

from volery.core.errors import NodeError
from volery.graph.nodes.node import Node

_MAX_DISTANCE_M = 1e6


def declare_numbers(
    node: Node, name: str, default: list[float], form: str, *, or_empty: bool = False
) -> list[float]:
    """Declares a parameter of as many finite numbers as `form` names, such as `[x, y, z]`.

    It may be empty if `or_empty` is true. Raises NodeError for other values.
    """
    value = node.declare_parameter(name, default).value
    if (or_empty and not len(value)) or (
        len(value) == form.count(",") + 1 and all(map(_is_number, value))
    ):
        return [float(number) for number in value]
    raise NodeError(
        f"{name} must be {form}, finite numbers{', or empty' if or_empty else ''}, not {value!r}"
    )


def declare_points(node: Node, name: str, default: list[list[float]]) -> list[list[float]]:
    """Declares a parameter of points [x, y] in the map, m. Raises NodeError for other values."""
    value = node.declare_parameter(name, default).value
    if all(
        isinstance(point, list | tuple)
        and len(point) == len("xy")
        and all(_is_number(x) and abs(x) <= _MAX_DISTANCE_M for x in point)
        for point in value
    ):
        return [[float(x) for x in point] for point in value]
    raise NodeError(
        f"{name} must be a list of [x, y], m, within +-{_MAX_DISTANCE_M:g}, not {value!r}"
    )


def declare_mount(node: Node, lidar: str) -> list[float]:
    """Declares the parameter `LIDAR_mount`: the LIDAR's position in the body, m."""
    return declare_numbers(node, f"{lidar}_mount", [0.0, 0.0, 0.0], "[x, y, z]")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
