"""The world of a flight as drawn on maps: ground, trees, solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from volery.figures.flight_data import Ground, Structures, Trees
from volery.figures.structures import seen_from_above
from volery.figures.trees import trees_of
from volery.world.mesh import Mesh


@dataclass(frozen=True, eq=False)
class DrawnWorld:
    """References the parts of a world; what is drawn is computed at the first drawing."""

    terrain: Any
    """Terrain with its grid of heights."""
    forest: Any
    """Forest; None without trees."""
    solids: Sequence[Mesh]
    """Meshes of buildings and other solids."""

    @property
    def ground(self) -> Ground:
        """Heights of the ground."""
        grid = self.terrain.grid
        return Ground(np.asarray(grid.heights), (grid.origin_x, grid.origin_y), grid.spacing)

    @cached_property
    def trees(self) -> Trees | None:
        """Trees from above; None without any."""
        return trees_of(self.forest)

    @cached_property
    def structures(self) -> Structures | None:
        """Solids from above; None without any."""
        return seen_from_above(self.solids)
