"""Winds that vary over the map: velocities on a regular 3-D grid, interpolated trilinearly.

Beyond the grid the velocity is that of its nearest border.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel
from volery.core.errors import CommandError
from volery.scenario.wind import MAX_WIND_M_S
from volery.world.weather.wind_field_files import read_wind_field


@dataclass(frozen=True, eq=False, repr=False, slots=True)
class WindField:
    """A regular grid of velocities; [k, j, i] is at origin + (i, j, k) * spacing.

    velocity_map: (Z, Y, X, 3) m/s, read-only. origin_map: (3,) m. spacing_m: (3,) along x, y, z.
    Along an axis with one node the wind is constant. Raises `CommandError` for other arrays.
    """

    velocity_map: Array
    origin_map: tuple[float, float, float]
    spacing_m: tuple[float, float, float]

    def __post_init__(self) -> None:
        velocity = np.array(self.velocity_map, dtype=np.float64, order="C")
        if velocity.ndim != 4 or velocity.shape[3] != 3 or 0 in velocity.shape:
            raise CommandError(f"a wind field has shape (Z, Y, X, 3), not {velocity.shape}")
        if not (np.abs(velocity) <= MAX_WIND_M_S).all():
            raise CommandError(
                f"a wind field's components must be finite and within +-{MAX_WIND_M_S:g} m/s"
            )
        velocity.flags.writeable = False
        spacing = _three("spacing_m", self.spacing_m)
        if min(spacing) <= 0.0:
            raise CommandError(f"a wind field's spacing must be positive, not {spacing}")
        object.__setattr__(self, "velocity_map", velocity)
        object.__setattr__(self, "origin_map", _three("origin_map", self.origin_map))
        object.__setattr__(self, "spacing_m", spacing)

    @classmethod
    def from_file(cls, path: str | Path) -> WindField:
        """Reads a .csv or .npz file; raises one `DataFileError` for all invalid rows."""
        return cls(*read_wind_field(Path(path)))


def nodes_of(field: WindField | None) -> Array:
    """Returns nodes (Z, Y, X, 3) m/s for kernels, at least two per axis; zeros without a field."""
    if field is None:
        return np.zeros((2, 2, 2, 3))
    twice = [(0, int(n == 1)) for n in field.velocity_map.shape[:3]]
    return np.pad(field.velocity_map, [*twice, (0, 0)], mode="edge")


@inner_kernel
def field_velocity(air: Any, nodes: Array, position: Array) -> tuple[float, float, float]:
    """Returns the velocity (x, y, z) m/s, map, of the field at `position` (3,) m.

    air: an `AIR` record with `field_origin` and `field_inverse_spacing`.
    """
    i, u = _cell(air, position, 0, nodes.shape[2])
    j, v = _cell(air, position, 1, nodes.shape[1])
    k, w = _cell(air, position, 2, nodes.shape[0])
    return (
        _trilinear(nodes, i, j, k, u, v, w, 0),
        _trilinear(nodes, i, j, k, u, v, w, 1),
        _trilinear(nodes, i, j, k, u, v, w, 2),
    )


@inner_kernel
def _cell(air: Any, position: Array, axis: int, count: int) -> tuple[int, float]:
    """Returns the number of the cell along an axis and the position in it, 0 to 1."""
    index = (position[axis] - air.field_origin[axis]) * air.field_inverse_spacing[axis]
    index = min(max(index, 0.0), count - 1.0)
    cell = max(min(int(index), count - 2), 0)
    return cell, index - cell


@inner_kernel
def _trilinear(
    nodes: Array, i: int, j: int, k: int, u: float, v: float, w: float, component: int
) -> float:
    low = _bilinear(nodes, i, j, k, u, v, component)
    high = _bilinear(nodes, i, j, k + 1, u, v, component)
    return low + w * (high - low)


@inner_kernel
def _bilinear(nodes: Array, i: int, j: int, k: int, u: float, v: float, component: int) -> float:
    near = nodes[k, j, i, component]
    near += u * (nodes[k, j, i + 1, component] - near)
    far = nodes[k, j + 1, i, component]
    far += u * (nodes[k, j + 1, i + 1, component] - far)
    between: float = near + v * (far - near)
    return between


def _three(what: str, value: ArrayLike) -> tuple[float, float, float]:
    vector = np.asarray(value, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise CommandError(f"a wind field's {what} must be three finite numbers")
    x, y, z = vector.tolist()
    return x, y, z
