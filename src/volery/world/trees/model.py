"""Tree models: one shape at three levels of detail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from volery.world.mesh import Mesh

BREAST_HEIGHT_M = 1.3
"""Height above the foot at which foresters measure a trunk's diameter (dbh)."""


class DetailLevel(StrEnum):
    """Level of detail of a tree. All levels let about the same fraction of rays through."""

    VISUAL = "visual"
    """For cameras and the page: every leaf has its own quad."""
    SENSING = "sensing"
    """For LIDARs and contact: fewer, larger leaves of the same projected area."""
    COARSE = "coarse"
    """For far views and large worlds."""


@dataclass(frozen=True)
class TreeMesh:
    """Surface of a tree, foot of the trunk at the origin, z up."""

    wood: Mesh
    leaves: Mesh


@dataclass(frozen=True, eq=False)
class TreeModel:
    """One variant of a species in one size class; many trees of a forest share it.

    height_m: highest point above the foot. dbh_m: trunk diameter at breast height. levels: the
    surface at each level of detail, grown on first use. stem: (K, 2) heights above the foot and
    radii of the trunk, m; linear between rows, as the mesh.
    """

    species: str
    variant: int
    height_m: float
    dbh_m: float
    levels: Mapping[DetailLevel, TreeMesh]
    stem: NDArray[np.float64]

    def stem_radius(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns trunk radii at heights above the foot, m."""
        return np.interp(height, self.stem[:, 0], self.stem[:, 1])
