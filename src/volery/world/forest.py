"""Forests: many trees that share few models.

A tree is a model with a position, a rotation about the vertical and a scale. The scale gives its
trunk diameter at breast height and its height exactly the values of the inventory (or drawn ones);
the model comes from the nearest size class of the species, so that scales are close to one. All
random numbers come from named streams of one seed: the same arguments give the same forest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import ScenarioError
from volery.core.plurals import counted
from volery.core.rng import generator
from volery.world.inventory import Inventory, read_inventory
from volery.world.species_map import shipped_species
from volery.world.terrain import Terrain
from volery.world.trees import BREAST_HEIGHT_M, Species, TreeModel, grow_models, load_species

Region = tuple[float, float, float, float]

_LOWEST_TREE_M = 0.3
_DARTS_PER_TREE = 30
"""Random positions tried for each tree before its forest counts as full."""


@dataclass(frozen=True, eq=False)
class Forest:
    """N trees, in the map frame.

    models: shapes that trees share. model_index: (N,) int32, rows of `models`. position_map: (N, 3)
    feet of the trunks on the ground, m. yaw: (N,) rad. scale: (N, 3) along the model's axes. dbh_m,
    height_m: (N,). species: N names.
    """

    models: tuple[TreeModel, ...]
    model_index: NDArray[np.int32]
    position_map: Array
    yaw: Array
    scale: Array
    dbh_m: Array
    height_m: Array
    species: tuple[str, ...]

    def __len__(self) -> int:
        """Number of trees."""
        return len(self.model_index)

    def tree_transforms(self) -> NDArray[np.float32]:
        """Returns transforms (N, 3, 4), map from tree model: point_map = T @ (point, 1)."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        sx, sy, sz = self.scale.T
        zero = np.zeros_like(cos)
        rows = [[cos * sx, -sin * sy, zero], [sin * sx, cos * sy, zero], [zero, zero, sz]]
        turn = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
        return np.concatenate([turn, self.position_map[:, :, None]], axis=2).astype(np.float32)


EMPTY_FOREST = Forest(
    models=(),
    model_index=np.zeros(0, np.int32),
    position_map=np.zeros((0, 3)),
    yaw=np.zeros(0),
    scale=np.zeros((0, 3)),
    dbh_m=np.zeros(0),
    height_m=np.zeros(0),
    species=(),
)
"""No trees."""


def forest_from_inventory(
    inventory: str | Path | Inventory,
    *,
    species: str,
    terrain: Terrain,
    region: Region | None = None,
    fraction: float = 1.0,
    seed: int = 0,
    diameters: str | None = None,
    species_map: Mapping[str, str] | None = None,
    position: tuple[float, float] = (0.0, 0.0),
) -> Forest:
    """Returns a forest of surveyed trees; missing sizes are drawn from the species' laws.

    inventory: a CSV file or the result of `read_inventory`.
    species: species of trees without one in the inventory, or with one that is not shipped; one
    warning counts the latter. species_map: shipped species by the inventory's names.
    position: of the inventory's origin in the map, x and y in m.
    region: (x0, y0, x1, y1) in the map, m; only trees with x0 <= x < x1 and y0 <= y < y1 are used.
    None uses all.
    fraction: of the trees, 0 to 1, chosen at random.
    diameters: name of the species' distribution of missing diameters (None: its "stand").
    Sizes are drawn for the whole inventory before the region is selected, so a tree is the same in
    every region and with every fraction. Raises `DataFileError` for an invalid file,
    `ScenarioError` for an unknown `species` or one in `species_map`.
    """
    trees = inventory if isinstance(inventory, Inventory) else read_inventory(inventory)
    trees = trees.moved(position)
    load_species(species)
    where = (
        f"inventory {Path(inventory).name}" if isinstance(inventory, str | Path) else "inventory"
    )
    names = np.array(
        shipped_species(trees.species, species, species_map or {}, where), dtype=object
    )
    dbh, height = trees.dbh_m.copy(), trees.height_m.copy()
    for name in sorted(set(names.tolist())):
        _draw_missing(
            load_species(name), np.flatnonzero(names == name), dbh, height, seed, diameters
        )
    yaw = _quarter_turns(len(trees), seed)
    variant = generator(seed, "forest/variant").random(len(trees))
    rows = np.arange(len(trees))
    if region is not None:
        _check(region)
        x, y = trees.position.T
        rows = rows[(x >= region[0]) & (x < region[2]) & (y >= region[1]) & (y < region[3])]
    if fraction < 1.0:
        rows = rows[generator(seed, "forest/thinning").random(len(trees))[rows] < fraction]
    return _assemble(
        trees.position[rows],
        names[rows],
        dbh[rows],
        height[rows],
        yaw[rows],
        variant[rows],
        terrain,
        seed,
    )


def procedural_forest(
    region: Region,
    *,
    species: Mapping[str, float] | Sequence[str] | str,
    terrain: Terrain,
    trees: int | None = None,
    density_per_ha: float | None = None,
    minimum_spacing_m: float = 1.0,
    seed: int = 0,
    diameters: str | None = None,
) -> Forest:
    """Returns a forest of trees at random positions in `region` (x0, y0, x1, y1), m.

    species: names with their fractions (normalised), or names alone for equal fractions.
    trees or density_per_ha: number or density of trees; give one of them.
    minimum_spacing_m: minimum distance between two trunks' axes.
    Raises `ScenarioError` if the trees do not fit, or for an unknown species.
    """
    _check(region)
    fractions = _fractions(species)
    if (trees is None) == (density_per_ha is None):
        raise ScenarioError("a procedural forest needs either trees or density_per_ha")
    area = (region[2] - region[0]) * (region[3] - region[1])
    count = trees if trees is not None else round(float(density_per_ha or 0.0) * area / 1e4)
    if count < 0 or not minimum_spacing_m >= 0.0:
        raise ScenarioError("the number of trees and their minimum spacing must not be negative")
    position = _throw(region, count, minimum_spacing_m, generator(seed, "forest/position"))
    names = np.array(list(fractions), dtype=object)
    picks = generator(seed, "forest/species").random(count)
    kind = np.searchsorted(np.cumsum(list(fractions.values())), picks, side="right")
    chosen = names[np.minimum(kind, len(names) - 1)]
    dbh, height = np.full(count, np.nan), np.full(count, np.nan)
    for name in sorted(fractions):
        _draw_missing(
            load_species(name), np.flatnonzero(chosen == name), dbh, height, seed, diameters
        )
    yaw = _quarter_turns(count, seed)
    variant = generator(seed, "forest/variant").random(count)
    return _assemble(position, chosen, dbh, height, yaw, variant, terrain, seed)


def _quarter_turns(count: int, seed: int) -> Array:
    """Returns yaws in steps of 90 degrees, which leaves bounding boxes as tight as the models'.

    Arbitrary yaws enlarge boxes by a quarter on average and cost a tenth of the rays per second;
    with several variants per size class there is no visible difference.
    """
    return np.asarray(0.5 * np.pi * generator(seed, "forest/yaw").integers(0, 4, count), np.float64)


def _check(region: Region) -> None:
    if not all(map(math.isfinite, region)) or region[0] >= region[2] or region[1] >= region[3]:
        raise ScenarioError(f"a forest's region must be x0 < x1 and y0 < y1, not {region}")


def _fractions(species: Mapping[str, float] | Sequence[str] | str) -> dict[str, float]:
    if isinstance(species, str):
        species = [species]
    mix = dict(species) if isinstance(species, Mapping) else dict.fromkeys(species, 1.0)
    for name, fraction in mix.items():
        load_species(name)
        if not (math.isfinite(fraction) and fraction > 0.0):
            raise ScenarioError(f"the share of species {name!r} must be above 0, not {fraction}")
    if not mix:
        raise ScenarioError("a procedural forest needs at least one species")
    total = sum(mix.values())
    return {name: fraction / total for name, fraction in mix.items()}


def _draw_missing(
    species: Species,
    rows: NDArray[np.intp],
    dbh: Array,
    height: Array,
    seed: int,
    diameters: str | None,
) -> None:
    """Replaces NaN diameters and heights of the trees in `rows`, in place."""
    drawn = species.spread(diameters).draw(
        generator(seed, f"forest/{species.name}/diameter"), len(rows)
    )
    dbh[rows] = np.where(np.isnan(dbh[rows]), drawn, dbh[rows])
    tall = species.heights(dbh[rows], generator(seed, f"forest/{species.name}/height"))
    tall = np.maximum(tall, _LOWEST_TREE_M)
    height[rows] = np.where(np.isnan(height[rows]), tall, height[rows])


def _throw(region: Region, count: int, spacing: float, rng: np.random.Generator) -> Array:
    """Draws positions one after the other; one too close to an earlier tree is drawn again."""
    low = np.array(region[:2])
    extent = np.array(region[2:]) - low
    if spacing == 0.0:
        return np.asarray(low + extent * rng.random((count, 2)))
    # cells so small that each holds one tree at most: neighbours lie within two cells
    cell = spacing / math.sqrt(2.0)
    around = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if abs(i) + abs(j) < 4]
    taken: dict[tuple[int, int], tuple[float, float]] = {}
    nearest = spacing * spacing
    for _ in range(_DARTS_PER_TREE):
        darts = low + extent * rng.random((count, 2))
        for x, y in darts.tolist():
            if len(taken) == count:
                break
            i, j = int((x - region[0]) / cell), int((y - region[1]) / cell)
            if all(
                (other := taken.get((i + di, j + dj))) is None
                or (other[0] - x) ** 2 + (other[1] - y) ** 2 >= nearest
                for di, dj in around
            ):
                taken[i, j] = (x, y)
        if len(taken) == count:
            return np.array(list(taken.values())).reshape(count, 2)
    raise ScenarioError(
        f"only {len(taken)} of {counted(count, 'tree')} fit into region {region} "
        f"at a minimum spacing of {spacing:g} m"
    )


def _assemble(
    position: Array,
    names: NDArray[np.object_],
    dbh: Array,
    height: Array,
    yaw: Array,
    variant: Array,
    terrain: Terrain,
    seed: int,
) -> Forest:
    """Assigns each tree the variant of its nearest size class given by the draw `variant`."""
    if not len(position):
        return EMPTY_FOREST
    models: list[TreeModel] = []
    index = np.zeros(len(position), np.int32)
    for name in sorted(set(names.tolist())):
        species = load_species(name)
        rows = np.flatnonzero(names == name)
        grown = grow_models(species, seed)
        distance = np.hypot(
            np.log(dbh[rows, None] / [m.dbh_m for m in grown[:: species.variants]]),
            np.log(height[rows, None] / [m.height_m for m in grown[:: species.variants]]),
        )
        size_class = distance.argmin(axis=1)
        shape = np.minimum(
            (variant[rows] * species.variants).astype(np.int64), species.variants - 1
        )
        used, index_of_row = np.unique(size_class * species.variants + shape, return_inverse=True)
        index[rows] = len(models) + index_of_row
        models.extend(grown[k] for k in used)
    scale = _scales(models, index, dbh, height)
    x, y = position.T
    feet = np.stack([x, y, terrain.height(x, y)], axis=1)
    return Forest(tuple(models), index, feet, yaw, scale, dbh, height, tuple(str(n) for n in names))


def _scales(
    models: Sequence[TreeModel], index: NDArray[np.int32], dbh: Array, height: Array
) -> Array:
    """Returns scales (N, 3) that give each tree its own diameter at breast height and height."""
    scale = np.empty((len(index), 3))
    scale[:, 2] = height / np.array([m.height_m for m in models])[index]
    breast = np.minimum(BREAST_HEIGHT_M, 0.5 * height) / scale[:, 2]
    for k, model in enumerate(models):
        rows = index == k
        scale[rows, :2] = (0.5 * dbh[rows] / model.stem_radius(breast[rows]))[:, None]
    return scale
