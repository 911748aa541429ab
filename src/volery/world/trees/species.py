"""Species as data: one TOML file each in `species/`, every number with its source.

A new species that grows like one of the known forms needs a file and no code.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from volery.core.errors import ScenarioError
from volery.scenario.data_files import load_data_file
from volery.world.trees.allometry import (
    CrownWidth,
    Data,
    DiameterSpread,
    Finite,
    HeightLaw,
    Positive,
)

_FOLDER = Path(__file__).parent / "species"

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Pair = tuple[Positive, Positive]


class Trunk(Data):
    """Shape of the trunk. Pairs hold the value of the thinnest and the thickest size class."""

    taper: Positive
    """Exponent of radius over the remaining height: 0 a cylinder, 1 a cone."""
    flare: Positive
    """Radius at the foot over the radius above the roots."""
    bend: Annotated[float, Field(ge=0.0, le=0.5)]
    """Sideways shift of the stem over its height, about."""
    source: str


class Crown(Data):
    """Shape of the crown. Pairs hold the value of the thinnest and the thickest size class."""

    base: tuple[Share, Share]
    """Height of the lowest branches as a share of the tree's height."""
    branches: Pair
    """Branches on the trunk (fronds of a palm)."""
    angle_deg: tuple[Finite, Finite]
    """Angle between trunk and branch, lowest and highest branch."""
    lift: Finite
    """How far branches bend up over their length, rad."""
    widest: Share
    """Where the crown is widest, as a share of its depth from below."""
    roundness: Share
    """Outline above the widest place: 1 an ellipse, 0 a straight cone."""
    twigs: Pair
    """Side shoots a branch."""
    source: str


class Leaf(Data):
    """A leaf (needle bundle, leaflet) as the visual level shows it."""

    length_m: Positive
    width_m: Positive
    area_index: Pair
    """One-sided leaf area over the crown's projected area, thinnest and thickest size class."""
    most: Annotated[int, Field(ge=1, le=40_000)]
    """Leaves of a tree at most; beyond it they grow instead, area kept."""
    droop: Finite
    """How far leaves hang, rad."""
    source: str


class Simplified(Data):
    """A coarser level: how many triangles stand for the leaves, and how much they spread."""

    leaf_triangles: tuple[int, int]
    """Triangles for the leaves of the thinnest and the thickest size class."""
    spread: tuple[float, float]
    """Area of the stand-ins over that of the leaves; set so that gap fractions agree."""


class Species(Data):
    """A species file."""

    name: str
    title: str
    form: Literal["broadleaf", "pine", "spruce", "palm", "snag"]
    wood_source: str = ""
    size_classes_cm: Annotated[tuple[Positive, ...], Field(min_length=1)]
    """Trunk diameters at which variants are grown; trees take the nearest and scale it."""
    variants: Annotated[int, Field(ge=1, le=20)]
    """Shapes a size class."""
    height_scatter: Annotated[float, Field(ge=0.0, le=0.5)]
    """Standard deviation of the logarithm of height about the law (a modelling choice)."""
    height: HeightLaw
    crown_width: CrownWidth
    trunk: Trunk
    crown: Crown
    leaf: Leaf | None = None
    sensing: Simplified | None = None
    coarse: Simplified | None = None
    diameters: dict[str, DiameterSpread]
    """Named spreads; `stand` is used where nothing else is asked for."""

    @model_validator(mode="after")
    def _has_what_it_names(self) -> Self:
        if "stand" not in self.diameters:
            raise ValueError("diameters must hold a spread named 'stand'")
        if list(self.size_classes_cm) != sorted(self.size_classes_cm):
            raise ValueError("size_classes_cm must ascend")
        if self.leaf is not None and (self.sensing is None or self.coarse is None):
            raise ValueError("a species with leaves needs [sensing] and [coarse]")
        return self

    def spread(self, name: str | None = None) -> DiameterSpread:
        """The spread of diameters called `name`, or the stand's."""
        try:
            return self.diameters[name or "stand"]
        except KeyError:
            known = ", ".join(sorted(self.diameters))
            raise ScenarioError(
                f"species {self.name} has no spread of diameters {name!r}; it has {known}"
            ) from None

    def heights(self, dbh_m: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Heights by the species' law, with its scatter, m."""
        scatter = np.exp(self.height_scatter * np.clip(rng.standard_normal(len(dbh_m)), -2.5, 2.5))
        return np.asarray(self.height.height(dbh_m) * scatter)

    def maturity(self, size_class: int) -> float:
        """Where a size class stands between the thinnest (0) and the thickest (1), by logarithm."""
        classes = np.log(self.size_classes_cm)
        reach = classes[-1] - classes[0]
        return float((classes[size_class] - classes[0]) / reach) if reach > 0.0 else 1.0


def species_names() -> tuple[str, ...]:
    """Names of the species that ship, sorted."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.toml")))


@cache
def load_species(name: str) -> Species:
    """The species `name`; raises ScenarioError that lists the known ones, or DataFileError."""
    if name not in species_names():
        raise ScenarioError(f"unknown tree species {name!r}; known: {', '.join(species_names())}")
    return load_data_file(_FOLDER / f"{name}.toml", Species)
