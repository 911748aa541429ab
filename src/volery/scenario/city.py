"""Scenario data of a city from building outlines."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, NonNegative, check_rectangle

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Length = Annotated[float, Field(ge=0.5, le=1000.0)]


class Streets(Data):
    """Streets in the gaps between buildings, and their furniture."""

    max_width_m: Annotated[float, Field(ge=4.0, le=200.0)] = 32.0
    """Wider gaps are not streets: they have the ground's own material."""
    pavement_m: Annotated[float, Field(ge=0.5, le=20.0)] = 3.0
    """Width from the walls to the kerb."""
    lamp_spacing_m: NonNegative = 28.0
    """Spacing along the kerb; 0: no lamps."""
    tree_spacing_m: NonNegative = 11.0
    """Spacing along the kerb of streets with room for trees; 0: none."""
    tree_fraction: Share = 0.6
    """Fraction of the tree positions that have a tree."""
    tree_species: str = "broadleaf"
    """Species of the street trees."""


class City(Data):
    """Buildings from the outlines of a GeoJSON file, around `world.origin`."""

    file: str
    """GeoJSON file of building outlines."""
    region_m: tuple[float, float, float, float] | None = None
    """x_min, y_min, x_max, y_max; only buildings whose centre lies in it are used; None: all.
    """
    storey_m: Annotated[float, Field(ge=2.0, le=10.0)] = 3.2
    """Height of a storey where only the number of levels is known."""
    default_height_m: Length = 16.0
    """Height of buildings without data in the file: five storeys."""
    streets: Streets = Streets()
    """Streets between the buildings."""

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self

    @model_validator(mode="after")
    def _spacings_are_sane(self) -> Self:
        for name in ("lamp_spacing_m", "tree_spacing_m"):
            spacing = getattr(self.streets, name)
            if 0.0 < spacing < 2.0:
                raise ValueError(f"streets.{name} must be 0, for none, or at least 2")
        return self
