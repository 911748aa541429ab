"""The ground is one continuous surface, and its normal is the slope of its height."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from volery.world.terrain import Terrain

heights = arrays(
    np.float64,
    array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=6),
    elements=st.floats(-50.0, 50.0),
)
fraction = st.floats(0.001, 0.999)


@settings(max_examples=200)
@given(heights, st.floats(0.5, 20.0), fraction, fraction)
def test_height_is_continuous_and_inside_the_cell(grid, spacing, u, v):
    terrain = Terrain.from_heights(grid, spacing, (-3.0, 7.0))
    x0, y0, x1, y1 = terrain.bounds
    x, y = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
    step = 1e-7 * spacing
    near = terrain.height(x + np.array([0.0, step, 0.0]), y + np.array([0.0, 0.0, step]))
    assert np.ptp(near) <= 1e-7 * 2.0 * np.ptp(grid) + 1e-9
    assert grid.min() - 1e-9 <= near[0] <= grid.max() + 1e-9


@settings(max_examples=200)
@given(heights, st.floats(0.5, 20.0), fraction, fraction)
def test_normal_is_unit_upward_and_square_to_the_surface(grid, spacing, u, v):
    terrain = Terrain.from_heights(grid, spacing)
    x0, y0, x1, y1 = terrain.bounds
    x, y = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
    normal = terrain.normal(x, y)
    assert normal[2] > 0.0
    np.testing.assert_allclose(np.linalg.norm(normal), 1.0, atol=1e-12)
    # walk a little, staying in the same triangle where the point is not on its edge
    local = np.array([x / spacing % 1.0, y / spacing % 1.0])
    room = min(abs(local[0] - local[1]), *local, *(1.0 - local))
    if room > 1e-3:
        step = 0.2 * room * spacing
        rise = terrain.height(x + step, y) - terrain.height(x, y)
        np.testing.assert_allclose(normal @ [step, 0.0, rise], 0.0, atol=1e-9 * (1 + abs(rise)))
