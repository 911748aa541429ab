"""Common parts of all tree forms: stem, leaf-bearing shoots, and meshes of each level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.world.mesh import EMPTY, Mesh, concatenate
from volery.world.trees.branches import UP, Branches, across, tubes, unit
from volery.world.trees.foliage import Blades, quads, stand_ins
from volery.world.trees.model import BREAST_HEIGHT_M, DetailLevel, TreeMesh
from volery.world.trees.species import Simplified, Species

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Angle between successive branches, which distributes them evenly around the stem."""


class Facets(NamedTuple):
    """Resolution of a shoot's tube; zero sides omit it."""

    segments: int
    sides: int


_FACETS: dict[DetailLevel, tuple[Facets, ...]] = {
    DetailLevel.VISUAL: (Facets(99, 12), Facets(99, 6), Facets(4, 4), Facets(2, 3)),
    DetailLevel.SENSING: (Facets(99, 7), Facets(3, 3), Facets(0, 0), Facets(0, 0)),
    DetailLevel.COARSE: (Facets(99, 5), Facets(2, 3), Facets(0, 0), Facets(0, 0)),
}
"""By order: stem, limbs on the stem, shoots on the limbs, twigs. All levels share the stem's rings
so that the trunk has the same radius everywhere. Thin shoots exist at the visual level only: they
are hidden among the leaves, whose simplified versions compensate for them, and their long boxes
slow every ray."""


@dataclass(frozen=True, eq=False)
class Site:
    """Parameters for growing one variant: sizes in m, maturity 0 thin to 1 thick."""

    species: Species
    height: float
    dbh: float
    maturity: float
    rng: np.random.Generator

    def between(self, pair: tuple[float, float]) -> float:
        """Returns the value for this size class from those of the thinnest and the thickest."""
        return pair[0] + (pair[1] - pair[0]) * self.maturity

    def count(self, pair: tuple[float, float]) -> int:
        """Returns the number for this size class; numbers grow geometrically."""
        return max(1, round(float(pair[0] * (pair[1] / pair[0]) ** self.maturity)))

    @property
    def crown_radius(self) -> float:
        """Radius of the crown, m."""
        return self.species.crown_width.radius(self.dbh)

    @property
    def crown_base(self) -> float:
        """Height of the lowest branches, m."""
        return self.height * self.between(self.species.crown.base)

    def envelope(self, fraction: Array) -> Array:
        """Returns the fraction of the crown radius at `fraction` of its depth from below."""
        widest, power = self.species.crown.widest, 1.0 + self.species.crown.roundness
        below = (widest - fraction) / (widest + 0.35)
        above = (fraction - widest) / (1.0 - widest + 0.03)
        beside = np.clip(np.where(fraction < widest, below, above), 0.0, 0.999)
        return np.asarray((1.0 - beside**power) ** (1.0 / power))


@dataclass(frozen=True, eq=False)
class Growth:
    """A grown variant: stem (one shoot), limbs by order, leaves in order of growth."""

    stem: Branches
    limbs: Sequence[Branches]
    blades: Blades | None = None
    capped: bool = False

    def fitted(self, height: float, radius: float) -> Growth:
        """Returns the tree within its allometry: a crown of about `radius`, `height` exactly, m.

        Shoots far outside are drawn in, so that bounding boxes are tight.
        """

        def drawn_in(points: Array) -> Array:
            axis, _ = on_stem(self.stem, points[..., 2].ravel())
            axis = axis.reshape(points.shape) * np.array([1.0, 1.0, 0.0])
            out = points[..., :2] - axis[..., :2]
            far = np.linalg.norm(out, axis=-1, keepdims=True)
            kept, rest = 0.75 * radius, 0.4 * radius
            near = kept + rest * np.tanh((far - kept) / rest)
            factor = np.where(far > kept, near / np.maximum(far, 1e-9), 1.0)
            return np.concatenate([axis[..., :2] + factor * out, points[..., 2:]], axis=-1)

        limbs = [Branches(drawn_in(b.points), b.radii) for b in self.limbs]
        blades = self.blades
        tops = [float(b.points[..., 2].max()) for b in (self.stem, *limbs)]
        if blades is not None and len(blades):
            blades = replace(blades, middle=drawn_in(blades.middle))
            half_height = np.abs(0.5 * blades.length * blades.axis[:, 2])
            tops.append(float((blades.middle[:, 2] + half_height).max()))
        factor = height / max(tops)
        return Growth(
            self.stem.scaled_z(factor),
            [b.scaled_z(factor) for b in limbs],
            None if blades is None else blades.scaled_z(factor),
            self.capped,
        )

    def wood(self, level: DetailLevel) -> Mesh:
        """Returns stem and limbs as tubes."""
        parts = []
        for order, shoots in enumerate((self.stem, *self.limbs)):
            facets = _FACETS[level][min(order, 3)]
            if facets.sides:
                capped = self.capped and (order == 0 or level is DetailLevel.VISUAL)
                parts.append(tubes(shoots.decimated(facets.segments), facets.sides, capped=capped))
        return concatenate(parts)

    def mesh(
        self,
        level: DetailLevel,
        height: float,
        simplified: tuple[int, float] | None,
        rng: np.random.Generator,
    ) -> TreeMesh:
        """Returns the surface at a level; its highest point is `height`, m.

        simplified: number of leaf triangles and their spread; None uses every leaf.
        """
        if self.blades is None:
            leaves = EMPTY
        elif simplified is None:
            leaves = quads(self.blades)
        else:
            leaves = stand_ins(self.blades, *simplified, rng)
        wood = self.wood(level)
        top = max(float(m.bounds[1, 2]) for m in (wood, leaves) if len(m))
        base = max(0.0, float(self.limbs[0].points[:, 0, 2].min()))
        return TreeMesh(*(_reaching(m, base, top, height) for m in (wood, leaves)))


def _reaching(mesh: Mesh, base: float, top: float, height: float) -> Mesh:
    """Stretches the mesh of a tree with top at `top` above `base`, to reach `height`."""
    z = mesh.vertices[:, 2].astype(np.float64)
    stretched = base + (z - base) * (height - base) / (top - base)
    vertices = mesh.vertices.copy()
    vertices[:, 2] = np.minimum(np.where(z > base, stretched, z), height)
    return Mesh(vertices, mesh.triangles)


def simplification(species: Species, level: DetailLevel, maturity: float) -> tuple[int, float]:
    """Returns the number of leaf triangles and their spread at a coarser level."""
    rule = species.sensing if level is DetailLevel.SENSING else species.coarse
    assert isinstance(rule, Simplified)
    few, many = rule.leaf_triangles
    low, high = rule.spread
    return round(few * (many / few) ** maturity), low + (high - low) * maturity


def stem(site: Site, *, top: float | None = None, broken: float = 0.0) -> Branches:
    """Grows the trunk up to `top` (the tree's height), with roots below the ground for slopes.

    broken: missing fraction of the former height; the trunk ends thick.
    """
    trunk = site.species.trunk
    top = site.height if top is None else top
    breast = min(BREAST_HEIGHT_M, 0.5 * top)
    sink = 2.5 * site.dbh + 0.05
    roots = 0.9 * site.dbh + 0.05
    low = np.array([-sink, 0.0, roots, breast])
    z = np.unique(np.concatenate([low[low < top], np.linspace(breast, top, 11)]).round(6))
    whole = top / (1.0 - broken) if broken else 1.02 * top

    def profile(height: Array | float) -> Array:
        left = np.clip(1.0 - np.asarray(height) / whole, 0.0, None) ** trunk.taper
        swell = 1.0 + (trunk.flare - 1.0) * np.exp(-np.maximum(height, 0.0) / roots)
        return np.asarray(left * swell)

    radius = 0.5 * site.dbh * profile(np.maximum(z, 0.0)) / profile(breast)
    phase = site.rng.uniform(0.0, 2.0 * np.pi, (2, 2))
    weight = site.rng.normal(0.0, trunk.bend * top, (2, 2)) * np.array([[1.0], [0.4]])
    course = np.clip(z / top, 0.0, None)[:, None, None] * np.array([[2.2], [5.5]])
    sway = (weight * (np.sin(course + phase) - np.sin(phase))).sum(axis=1)
    points = np.concatenate([sway, z[:, None]], axis=1)
    return Branches(points[None], np.maximum(radius, 0.002)[None])


def on_stem(trunk: Branches, height: Array) -> tuple[Array, Array]:
    """Returns points (N, 3) and radii (N,) of the trunk at heights (N,), m."""
    line, radii = trunk.points[0], trunk.radii[0]
    x, y, r = (np.interp(height, line[:, 2], a) for a in (line[:, 0], line[:, 1], radii))
    return np.stack([x, y, height], axis=1), r


def leaf_count(site: Site) -> tuple[int, float]:
    """Returns the number of leaves and their total area, m^2."""
    leaf = site.species.leaf
    assert leaf is not None
    area = site.between(leaf.area_index) * np.pi * site.crown_radius**2
    each = 0.5 * leaf.length_m * leaf.width_m
    return int(np.clip(area / each, 24, leaf.most)), area


def along(
    shoots: Branches, count: int, rng: np.random.Generator, start: float = 0.15
) -> tuple[Array, Array]:
    """Returns `count` points spread evenly over the length of all shoots, from `start` of each on.

    The results are points and unit tangents (count, 3), in order of growth.
    """
    bounds = np.concatenate([[0.0], np.cumsum(shoots.lengths)])
    distance = (np.arange(count) + rng.random(count)) / count * bounds[-1]
    row = np.clip(np.searchsorted(bounds, distance, side="right") - 1, 0, len(shoots.points) - 1)
    fraction = start + (1.0 - start) * (distance - bounds[row]) / np.diff(bounds)[row]
    last = shoots.points.shape[1] - 1
    k = np.minimum((fraction * last).astype(np.int64), last - 1)
    begin, end = shoots.points[row, k], shoots.points[row, k + 1]
    return begin + (fraction * last - k)[:, None] * (end - begin), unit(end - begin)


def flat_leaves(
    points: Array,
    tangents: Array,
    site: Site,
    *,
    forward: float,
    tilt: float,
    grown: Array | float = 1.0,
) -> Blades:
    """Grows leaves in two rows along shoots, faces up, as for most plants.

    forward: inclination of leaves along the shoot (tangent against sideways). tilt: scatter of the
    faces about the vertical. grown: size of each leaf as a fraction of the species' leaf.
    """
    leaf, rng, count = site.species.leaf, site.rng, len(points)
    assert leaf is not None
    level, _ = across(tangents)
    row = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)[:, None]
    scatter = rng.normal(0.0, 0.25, (count, 3))
    axis = unit(forward * tangents + row * level - leaf.droop * UP + scatter)
    side = unit(np.cross(UP + rng.normal(0.0, tilt, (count, 3)), axis))
    size = rng.uniform(0.75, 1.25, count) * grown
    length, width = leaf.length_m * size, leaf.width_m * size
    return Blades(points + 0.55 * length[:, None] * axis, axis, side, length, width)
