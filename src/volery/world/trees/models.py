"""Grows the tree models of a species, which a forest shares."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from volery.core.rng import generator
from volery.world.trees.broadleaf import broadleaf
from volery.world.trees.conifers import pine, spruce
from volery.world.trees.growth import Growth, Site, simplification
from volery.world.trees.model import BREAST_HEIGHT_M, DetailLevel, TreeMesh, TreeModel
from volery.world.trees.palm import palm
from volery.world.trees.snag import snag
from volery.world.trees.species import Species

_FORMS: dict[str, Callable[[Site], Growth]] = {
    "broadleaf": broadleaf,
    "pine": pine,
    "spruce": spruce,
    "palm": palm,
    "snag": snag,
}


class _GrownLevels(Mapping[DetailLevel, TreeMesh]):
    """Levels of one variant, meshed on first use; the order of use does not matter."""

    def __init__(self, mesh: Callable[[DetailLevel], TreeMesh]) -> None:
        self._mesh = mesh
        self._done: dict[DetailLevel, TreeMesh] = {}

    def __getitem__(self, level: DetailLevel) -> TreeMesh:
        level = DetailLevel(level)
        if level not in self._done:
            self._done[level] = self._mesh(level)
        return self._done[level]

    def __iter__(self) -> Iterator[DetailLevel]:
        return iter(DetailLevel)

    def __len__(self) -> int:
        return len(DetailLevel)


def grow_model(species: Species, size_class: int, variant: int, seed: int) -> TreeModel:
    """Grows one variant of a size class; the same arguments give the same bytes."""
    stream = f"tree/{species.name}/{size_class}/{variant}"
    dbh = species.size_classes_cm[size_class] / 100.0
    height = float(species.height.height(np.array([dbh]))[0])
    maturity = species.maturity(size_class)
    site = Site(species, height, dbh, maturity, generator(seed, stream))
    grown = _FORMS[species.form](site).fitted(height, site.crown_radius)

    def mesh(level: DetailLevel) -> TreeMesh:
        simple = None
        if level is not DetailLevel.VISUAL and species.leaf is not None:
            simple = simplification(species, level, maturity)
        return grown.mesh(level, height, simple, generator(seed, f"{stream}/{level}"))

    stem = np.stack([grown.stem.points[0, :, 2], grown.stem.radii[0]], axis=1)
    breast = min(BREAST_HEIGHT_M, 0.5 * height)
    dbh = 2.0 * float(np.interp(breast, stem[:, 0], stem[:, 1]))
    stem.flags.writeable = False
    return TreeModel(species.name, variant, height, dbh, _GrownLevels(mesh), stem)


def grow_models(species: Species, seed: int) -> tuple[TreeModel, ...]:
    """Returns all variants of all size classes, the thinnest class first."""
    return tuple(
        grow_model(species, size_class, variant, seed)
        for size_class in range(len(species.size_classes_cm))
        for variant in range(species.variants)
    )
