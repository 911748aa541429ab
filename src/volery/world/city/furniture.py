"""Street furniture: lamps on the pavement, rows of young trees along the kerb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.rng import generator
from volery.world.city.streets import Streets, kerb_lines
from volery.world.inventory import Inventory
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene_content import Solid
from volery.world.terrain import Terrain

_FROM_KERB_M = 0.5
"""Distance of a lamp's post from the kerb, on the pavement."""
_TREES_BEYOND_KERB_M = 1.2
"""Distance of trees from the kerb: in the parking lane, which keeps crowns off the walls."""
_TREE_ROADWAY_M = 9.0
"""Roadways narrower than this have no trees."""
_POST_M, _POST_RADIUS_M, _FOOT_M = 6.0, 0.08, 0.4
_ARM_M, _ARM_RADIUS_M = 1.2, 0.04
_HEAD_M = (0.5, 0.22, 0.12)
_TREE_DBH_M = (0.10, 0.24)
"""Trunks of street trees between planting and a few decades: crowns 4 to 8 m wide."""


@dataclass(frozen=True)
class FurnitureRule:
    """Spacing of objects along a street; modelling choices, as all sizes here.

    0 omits them. tree_fraction: fraction of the tree positions that have a tree.
    """

    lamp_spacing_m: float = 28.0
    tree_spacing_m: float = 11.0
    tree_fraction: float = 0.6


def place_lamps(streets: Streets, rule: FurnitureRule, seed: int) -> Array:
    """Returns lamps (L, 4): x and y, m, and the unit direction of the arm, over the street."""
    if not rule.lamp_spacing_m:
        return np.zeros((0, 4))
    from_wall_m = streets.rule.pavement_m - _FROM_KERB_M
    lines = kerb_lines(streets, max(from_wall_m, 0.3), 0.0)
    poses = _along(lines, rule.lamp_spacing_m, seed, "city/lamps")
    return poses[_apart(poses, 0.6 * rule.lamp_spacing_m)]


def place_trees(streets: Streets, rule: FurnitureRule, seed: int, lamps: Array) -> Inventory:
    """Returns street trees, none near a lamp; trunk diameters are drawn, heights follow."""
    poses = np.zeros((0, 4))
    if rule.tree_spacing_m:
        from_wall_m = streets.rule.pavement_m + _TREES_BEYOND_KERB_M
        lines = kerb_lines(streets, from_wall_m, _TREE_ROADWAY_M)
        poses = _along(lines, rule.tree_spacing_m, seed, "city/trees")
    kept = _apart(np.concatenate([lamps, poses]), 0.35 * rule.tree_spacing_m)[len(lamps) :]
    random = generator(seed, "city/tree").random((len(poses), 2))
    chosen = kept & (random[:, 0] < rule.tree_fraction)
    low, high = _TREE_DBH_M
    dbh = low + (high - low) * random[chosen, 1]
    count = len(dbh)
    return Inventory(poses[chosen, :2], dbh, np.full(count, np.nan), ("",) * count)


def _along(lines: Sequence[Array], spacing_m: float, seed: int, stream: str) -> Array:
    """Returns positions (n, 4) a spacing apart on lines, from random starts, with their right."""
    starts = generator(seed, stream).random(len(lines))
    poses = [np.zeros((0, 4))]
    for line, start in zip(lines, starts, strict=True):
        step = np.diff(line, axis=0)
        length = np.hypot(*step.T)
        end = np.cumsum(length)
        at = np.arange(start * spacing_m, end[-1], spacing_m)
        piece = np.minimum(np.searchsorted(end, at, side="right"), len(length) - 1)
        forward = step[piece] / length[piece, None]
        xy = line[piece] + (at - (end - length)[piece])[:, None] * forward
        poses.append(np.column_stack([xy, forward[:, 1], -forward[:, 0]]))
    return np.concatenate(poses)


def _apart(poses: Array, min_distance_m: float) -> NDArray[np.bool_]:
    """Returns which positions are at least `min_distance_m` from all earlier selected ones."""
    kept = np.zeros(len(poses), dtype=bool)
    cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
    side = max(min_distance_m, 1e-3)
    for k, (x, y) in enumerate(poses[:, :2].tolist()):
        i, j = int(x // side), int(y // side)
        near = (
            p for di in (-1, 0, 1) for dj in (-1, 0, 1) for p in cells.get((i + di, j + dj), ())
        )
        if all((x - px) ** 2 + (y - py) ** 2 >= min_distance_m**2 for px, py in near):
            kept[k] = True
            cells.setdefault((i, j), []).append((x, y))
    return kept


def lamp_solids(lamps: Array, terrain: Terrain) -> tuple[Solid, ...]:
    """Returns a solid for each lamp, with "lamp 1" and so on as names."""
    model = _lamp_model()
    ground = terrain.height(lamps[:, 0], lamps[:, 1])
    solids = []
    for number, ((x, y, ax, ay), z) in enumerate(zip(lamps, ground, strict=True), start=1):
        turn = [[ax, -ay, 0.0, x], [ay, ax, 0.0, y], [0.0, 0.0, 1.0, z]]
        solids.append(Solid(model.transformed(turn), Material.METAL, f"lamp {number}"))
    return tuple(solids)


def _lamp_model() -> Mesh:
    """Returns post, arm along x and head, each closed; the post's foot extends below the ground."""
    top = _POST_M
    length, width, height = _HEAD_M
    return concatenate(
        [
            _prism(_POST_RADIUS_M, -_FOOT_M, top, 6),
            _box((0.0, _ARM_M), (-_ARM_RADIUS_M, _ARM_RADIUS_M), (top - 0.06, top + 0.02)),
            _box((_ARM_M, _ARM_M + length), (-width / 2, width / 2), (top - height, top)),
        ]
    )


def _prism(radius_m: float, low_m: float, high_m: float, sides: int) -> Mesh:
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = [[x, y, z] for z in (low_m, high_m) for x, y in ring]
    faces = []
    for k in range(sides):
        n = (k + 1) % sides
        faces += [[k, n, sides + n], [k, sides + n, sides + k]]
    for k in range(1, sides - 1):
        faces += [[0, k + 1, k], [sides, sides + k, sides + k + 1]]
    return Mesh(np.array(points, np.float32), np.array(faces, np.uint32))


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Mesh:
    points = [
        [a, b, c] for c in z for a, b in ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))
    ]
    sides = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7)]
    faces = [f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))]
    return Mesh(np.array(points, np.float32), np.array(faces, np.uint32))
