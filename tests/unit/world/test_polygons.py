"""Polygons in space become triangles that cover their area, and nothing else."""

import numpy as np
import pytest
import shapely

from volery.world import polygons
from volery.world.polygons import triangulated


def area_of(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.cross(b - a, c - a).sum(axis=0) / 2.0


def covered(ring, **options):
    """The triangles of one polygon (n, 2) that stands anywhere in space."""
    ring = np.asarray(ring, dtype=float)
    turn = np.linalg.qr(np.random.default_rng(options.pop("seed", 0)).normal(size=(3, 3)))[0]
    points = np.pad(ring, ((0, 0), (0, 1))) @ turn.T + options.pop("at", 0.0)
    rows, owner = triangulated(points, np.arange(len(ring)), np.array([len(ring)]))
    assert owner.tolist() == [0] * (len(ring) - 2)
    return ring, points, rows


NOTCH = [(-3, 0), (-1, 0), (-1, 2), (1, 2), (1, 0), (3, 0), (3, 3), (-3, 3)]
ARROW = [(0, 0), (2, 1), (0, 2), (0.5, 1)]
MIDPOINTS = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
# the hole of the second ring is reached by a bridge that is walked twice
BRIDGED = [(0, 0), (6, 0), (6, 6), (0, 6), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)]
SPIRAL = [(0, 0), (9, 0), (9, 9), (1, 9), (1, 3), (6, 3), (6, 6), (4, 6), (4, 5), (5, 5), (5, 4),
          (2, 4), (2, 8), (8, 8), (8, 1), (0, 1)]  # fmt: skip


@pytest.mark.parametrize("ring", [NOTCH, ARROW, MIDPOINTS, BRIDGED, SPIRAL, SPIRAL[::-1]])
@pytest.mark.parametrize("at", [0.0, 4.5e6])
@pytest.mark.parametrize("first", [0, 1, 3])
def test_the_triangles_cover_the_polygon_alone(ring, at, first):
    ring, _, rows = covered(np.roll(ring, first, axis=0), at=at)
    whole = shapely.make_valid(shapely.Polygon(ring))
    pieces = [shapely.Polygon(ring[row]) for row in rows]
    assert sum(piece.area for piece in pieces) == pytest.approx(whole.area)
    assert shapely.union_all([p for p in pieces if p.area]).symmetric_difference(
        whole
    ).area == pytest.approx(0.0, abs=1e-9)
    signed = area_of(np.pad(ring, ((0, 0), (0, 1))), rows)[2]
    own = shapely.Polygon(ring).exterior.is_ccw
    assert (signed > 0) == own  # they turn as the polygon does


@pytest.mark.parametrize("ring", [MIDPOINTS, [(0, 0), (1, 0), (2, 0), (0, 2)]])
@pytest.mark.parametrize("first", range(4))
def test_corners_on_a_straight_edge_keep_triangles_with_an_area(ring, first):
    """A fan from them would have flat triangles, and an edge that its neighbour does not share."""
    _, points, rows = covered(np.roll(ring, first, axis=0))
    sizes = np.linalg.norm(np.cross(*(points[rows[:, k]] - points[rows[:, 0]] for k in (1, 2))),
                           axis=1)  # fmt: skip
    assert (sizes > 0.1).all()


def test_random_polygons_have_the_area_of_their_outline():
    random = np.random.default_rng(7)
    for size in (4, 5, 9, 40, 300):
        angles = np.sort(random.uniform(0.0, 2.0 * np.pi, size))
        ring = random.uniform(0.2, 1.0, size)[:, None] * np.stack(
            [np.cos(angles), np.sin(angles)], 1
        )
        if not shapely.Polygon(ring).is_valid:
            continue
        ring, _, rows = covered(ring, seed=size)
        pieces = sum(shapely.Polygon(ring[row]).area for row in rows)
        assert pieces == pytest.approx(shapely.Polygon(ring).area)


def test_several_polygons_keep_their_order():
    points = np.array([[x, y, 0.0] for x, y in [*NOTCH, *ARROW]])
    corners = np.array([8, 9, 10, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    rows, owner = triangulated(points, corners, np.array([3, 8, 4]))
    assert owner.tolist() == [0] + [1] * 6 + [2] * 2
    assert rows[0].tolist() == [8, 9, 10]
    assert np.abs(area_of(points, rows[owner == 1])[2]) == pytest.approx(14.0)


def test_crossing_and_flat_polygons_end_with_triangles():
    for ring in ([(0, 0), (1, 1), (1, 0), (0, 1)], [(0, 0), (1, 0), (2, 0), (3, 0), (1, 0)],
                 [(0, 0)] * 6, [(0, 0), (4, 3), (0, 3), (4, 0), (2, 5)]):  # fmt: skip
        _, points, rows = covered(ring)
        assert rows.min() >= 0
        assert rows.max() < len(points)


def test_a_huge_concave_polygon_is_refused_and_a_convex_one_read(monkeypatch):
    monkeypatch.setattr(polygons, "MAX_CORNERS", 7)
    with pytest.raises(ValueError, match="not convex has 8 corners"):
        covered(NOTCH)
    angles = np.arange(9) * 2.0 * np.pi / 9.0
    _, _, rows = covered(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert len(rows) == 7
