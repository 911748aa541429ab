"""The world of a scenario: ground, trees, buildings, actors, air, light."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from volery.core.quantities import Quantity
from volery.scenario.actors import Actors, check_actors
from volery.scenario.base import (
    PROJECTED,
    Data,
    NonNegative,
    Positive,
    Vector2,
    check_rectangle,
)
from volery.scenario.camera import Daylight
from volery.scenario.city import City
from volery.scenario.grid_map import GridMapWorld
from volery.scenario.navigation import DeniedArea, MagneticField, Origin
from volery.scenario.user_mesh import UserMesh
from volery.scenario.weather import Weather
from volery.scenario.wind import Wind


class FlatTerrain(Data):
    """Horizontal ground from -extent_m to extent_m in x and y."""

    kind: Literal["flat"] = "flat"
    """Level ground."""
    extent_m: Positive = 500.0
    """Half the side of the ground."""
    height_m: float = 0.0
    """Height of the ground, z in the map."""


class GridTerrain(Data):
    """A heightfield from a CSV grid: row k holds the elevations at y = k * spacing.

    An ESRI ASCII grid is read, too; its first row is at the highest y.
    """

    kind: Literal["grid"] = "grid"
    """Ground from a grid of elevations."""
    file: str
    """CSV file or ESRI ASCII grid of elevations in m."""
    spacing_m: Positive
    """Distance between neighbours of the grid."""
    origin_m: Vector2 = (0.0, 0.0)
    """Position x, y of the first elevation in the map."""


class InventoryForest(Data):
    """Trees at surveyed positions: CSV with `x_m,y_m[,dbh_cm,height_m,species]`."""

    kind: Literal["inventory"] = "inventory"
    """Trees at surveyed positions."""
    file: str
    """CSV file of the trees."""
    species: str
    """Species of trees without one in the inventory, or with one that is neither shipped nor
    mapped."""
    species_map: Annotated[dict[str, str], Field(max_length=10_000)] = Field(default_factory=dict)
    """Shipped species by the inventory's names of species."""
    position_m: Vector2 = (0.0, 0.0)
    """Position x, y of the file's origin in the map; for projected coordinates their negative
    values."""
    region_m: tuple[float, float, float, float] | None = None
    """x_min, y_min, x_max, y_max in the map; only trees with x_min <= x < x_max (y alike) are
    used; None: all."""
    fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Fraction of the trees, at random; a smaller fraction is a subset of a larger one."""

    quantities: ClassVar[Mapping[str, Quantity]] = {"position_m": PROJECTED}

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self


class ProceduralForest(Data):
    """Trees at random positions with a minimum spacing."""

    kind: Literal["procedural"] = "procedural"
    """Trees at random positions."""
    region_m: tuple[float, float, float, float]
    """x_min, y_min, x_max, y_max of the forest in the map."""
    trees: Annotated[int, Field(ge=0, le=200_000)]
    """Number of trees; all must fit into the region."""
    minimum_spacing_m: NonNegative = 1.0
    """Minimum distance between two trunks."""
    species: Annotated[dict[str, Positive], Field(min_length=1)]
    """Fractions by species; they are normalised."""

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self


class World(Data):
    """Ground, trees, buildings, actors, air."""

    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    """Seed of the world alone; None: the scenario's seed is used."""
    terrain: Annotated[FlatTerrain | GridTerrain, Field(discriminator="kind")] = FlatTerrain()
    """Ground."""
    forest: Annotated[InventoryForest | ProceduralForest | None, Field(discriminator="kind")] = None
    """Trees; None: there are none."""
    city: City | None = None
    """Buildings and streets; None: there are none."""
    grid_map: GridMapWorld | None = None
    """Blocks from a matrix; None: there are none."""
    meshes: Annotated[tuple[UserMesh, ...], Field(max_length=1000)] = ()
    """Mesh files of the user."""
    actors: Actors = ()
    """People, vehicles and birds."""
    wind: Wind = Wind()
    """Motion of the air."""
    weather: Weather = Weather()
    """Rain, snow, fog and dust."""
    light: Daylight = Daylight()
    """Sun, and clearness of the air."""
    origin: Origin = Origin()
    """Position of the map's origin on the earth."""
    magnetic_field: MagneticField = MagneticField()
    """The earth's magnetic field."""
    gnss_denied: bool = False
    """Whether satellite signals are denied everywhere, for the whole run."""
    gnss_denied_areas: tuple[DeniedArea, ...] = ()
    """Areas without satellite signals."""

    @model_validator(mode="after")
    def _actors_have_names(self) -> Self:
        check_actors(self.actors)
        return self
