"""Leaves: small flat blades, and their simplification at coarser levels.

A coarser level uses a random fraction of the blades and enlarges them to preserve the total area:
the mean fraction of light that passes depends on total area, orientation and clumping, and is
preserved too (Cook, Halstead, Planck & Ryu 2007, "Stochastic simplification of aggregate detail").
Larger blades clump a little less, for which `spread` compensates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from volery.core.arrays import Array
from volery.world.mesh import EMPTY, Mesh

_LONGEST_STAND_IN = 2.2
"""Maximum length over width of a simplified leaf: slivers have poor bounding boxes."""
_FOLD = 0.12
"""Rise of a leaf's halves from its midrib, as a fraction of its width."""


@dataclass(frozen=True, eq=False)
class Blades:
    """N leaves: middle (N, 3), unit length axis and width axis (N, 3), length and width (N,), m.

    A blade is a rhombus of area length * width / 2.
    """

    middle: Array
    axis: Array
    side: Array
    length: Array
    width: Array

    def __len__(self) -> int:
        """Number of leaves."""
        return len(self.middle)

    @property
    def area(self) -> float:
        """One-sided area of all leaves, m^2."""
        return float((self.length * self.width).sum() / 2.0)

    def scaled_z(self, factor: float) -> Blades:
        """Returns the leaves on a tree stretched along z."""
        middle = self.middle * np.array([1.0, 1.0, factor])
        return Blades(middle, self.axis, self.side, self.length, self.width)

    def with_area(self, area: float) -> Blades:
        """Returns the leaves scaled to a total area of `area` m^2."""
        factor = np.sqrt(area / self.area) if len(self) else 1.0
        return Blades(self.middle, self.axis, self.side, self.length * factor, self.width * factor)


def quads(blades: Blades) -> Mesh:
    """Returns every leaf as two triangles that meet at the midrib, slightly folded."""
    if not len(blades):
        return EMPTY
    half = 0.5 * blades.length[:, None] * blades.axis
    wide = 0.5 * blades.width[:, None] * blades.side
    rise = _FOLD * blades.width[:, None] * np.cross(blades.axis, blades.side)
    near, far = blades.middle - half, blades.middle + half
    left, right = blades.middle + wide + rise, blades.middle - wide + rise
    vertices = np.stack([near, right, far, left], axis=1).reshape(-1, 3)
    pair = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int64)
    triangles = (4 * np.arange(len(blades)))[:, None, None] + pair
    return Mesh(vertices.astype(np.float32), triangles.reshape(-1, 3).astype(np.uint32))


def stand_ins(blades: Blades, count: int, spread: float, rng: np.random.Generator) -> Mesh:
    """Returns at most `count` triangles with `spread` times the total area of all leaves."""
    if not len(blades):
        return EMPTY
    # leaves are drawn evenly along the order of growth, so that no branch is bare
    count = min(count, len(blades))
    edges = np.linspace(0, len(blades), count + 1)
    chosen = (edges[:-1] + rng.random(count) * np.diff(edges)).astype(np.int64)
    length, width = blades.length[chosen], blades.width[chosen]
    area = 0.5 * length * width
    area *= spread * blades.area / area.sum()
    aspect = np.clip(length / width, 1.0 / _LONGEST_STAND_IN, _LONGEST_STAND_IN)
    long = np.sqrt(2.0 * area * aspect)[:, None] * blades.axis[chosen]
    wide = np.sqrt(2.0 * area / aspect)[:, None] * blades.side[chosen]
    # the triangle's centre of gravity is the leaf's middle
    middle = blades.middle[chosen]
    corners = [middle + long * 2.0 / 3.0, middle - long / 3.0 + wide / 2.0]
    corners.append(middle - long / 3.0 - wide / 2.0)
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    triangles = np.arange(3 * count, dtype=np.int64).reshape(-1, 3)
    return Mesh(vertices.astype(np.float32), triangles.astype(np.uint32))
