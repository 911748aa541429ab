"""Solids from above: tops, and the edges around them without those between triangles."""

import numpy as np
import pytest
import shapely

from volery.figures.structures import seen_from_above
from volery.world.city.buildings import extruded
from volery.world.mesh import Mesh


def test_a_block_with_a_courtyard():
    block = shapely.orient_polygons(
        shapely.MultiPolygon([shapely.box(0, 0, 30, 20) - shapely.box(10, 5, 15, 10)])
    )
    seen = seen_from_above([extruded(block, 0.0, 9.0), extruded(block, 0.0, 9.0)])
    a, b, c = np.moveaxis(seen.tops, 1, 0)
    u, v = b - a, c - a
    area = 0.5 * abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()
    assert area == pytest.approx(2 * block.area)
    length = np.linalg.norm(seen.edges[:, 1] - seen.edges[:, 0], axis=1).sum()
    assert length == pytest.approx(2 * block.length)


def test_nothing_to_see():
    upright = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1]]), np.array([[0, 1, 2]]))
    assert seen_from_above([]) is None
    assert seen_from_above([upright]) is None
