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
    """Approximate sideways shift of the stem over its height."""
    source: str


class Crown(Data):
    """Shape of the crown. Pairs hold the value of the thinnest and the thickest size class."""

    base: tuple[Share, Share]
    """Height of the lowest branches as a fraction of the tree's height."""
    branches: Pair
    """Branches on the trunk (fronds of a palm)."""
    angle_deg: tuple[Finite, Finite]
    """Angle between trunk and branch, lowest and highest branch."""
    lift: Finite
    """Upward bend of branches over their length, rad."""
    widest: Share
    """Position of the largest width, as a fraction of the crown's depth from below."""
    roundness: Share
    """Outline above the largest width: 1 an ellipse, 0 a straight cone."""
    twigs: Pair
    """Side shoots per branch."""
    source: str


class Leaf(Data):
    """A leaf (needle bundle, leaflet) at the visual level."""

    length_m: Positive
    width_m: Positive
    area_index: Pair
    """One-sided leaf area over the crown's projected area, thinnest and thickest size class."""
    most: Annotated[int, Field(ge=1, le=40_000)]
    """Maximum leaves of a tree; beyond it leaves grow in size, with the same total area."""
    droop: Finite
    """Droop of leaves, rad."""
    source: str


class Simplified(Data):
    """A coarser level: number of triangles for the leaves, and their spread."""

    leaf_triangles: tuple[int, int]
    """Triangles for the leaves of the thinnest and the thickest size class."""
    spread: tuple[float, float]
    """Area of the triangles over that of the leaves; set so that gap fractions agree."""


class Species(Data):
    """A species file."""

    name: str
    title: str
    form: Literal["broadleaf", "pine", "spruce", "palm", "snag"]
    wood_source: str = ""
    size_classes_cm: Annotated[tuple[Positive, ...], Field(min_length=1)]
    """Trunk diameters at which variants are grown; trees scale the nearest one."""
    variants: Annotated[int, Field(ge=1, le=20)]
    """Number of shapes per size class."""
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
    """Named spreads; `stand` is the default."""

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
        """Returns the spread of diameters called `name`, or the stand's.

        Raises `ScenarioError` if the species has no such spread.
        """
        try:
            return self.diameters[name or "stand"]
        except KeyError:
            known = ", ".join(sorted(self.diameters))
            raise ScenarioError(
                f"species {self.name} has no spread of diameters {name!r}; it has {known}"
            ) from None

    def heights(self, dbh_m: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Returns heights by the species' law, with its scatter, m."""
        scatter = np.exp(self.height_scatter * np.clip(rng.standard_normal(len(dbh_m)), -2.5, 2.5))
        return np.asarray(self.height.height(dbh_m) * scatter)

    def maturity(self, size_class: int) -> float:
        """Returns the logarithmic position of a size class, 0 the thinnest to 1 the thickest."""
        classes = np.log(self.size_classes_cm)
        span = classes[-1] - classes[0]
        return float((classes[size_class] - classes[0]) / span) if span > 0.0 else 1.0


def species_names() -> tuple[str, ...]:
    """Returns the names of the shipped species, sorted."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.toml")))


@cache
def load_species(name: str) -> Species:
    """Returns the species `name`.

    Raises `ScenarioError`, listing the known species, for an unknown name, or `DataFileError`.
    """
    if name not in species_names():
        raise ScenarioError(f"unknown tree species {name!r}; known: {', '.join(species_names())}")
    return load_data_file(_FOLDER / f"{name}.toml", Species)
