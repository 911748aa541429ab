"""Maps of flights from above."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from volery.figures.flight_data import FlightData, Ground, UavTrack
from volery.figures.maps import draw_top_view


@pytest.mark.parametrize("spacing_m", [0.0, 1.0, 4.0, 30.0])
def test_names_at_the_ends_of_paths_do_not_overlap(spacing_m):
    tracks = []
    for k in range(9):
        path = np.array([[spacing_m * (k % 5), spacing_m * (k // 5), 2.0]] * 2)
        none = np.zeros(2)
        tracks.append(UavTrack(f"uav{k + 1}", np.arange(2.0), path, none, none, none))
    ground = Ground(np.zeros((2, 2)), (-50.0, -50.0), 400.0)
    flight = FlightData("rows", "", 1, 1.0, 1.0, 0.0, tuple(tracks), ground)
    figure = Figure(figsize=(6.4, 4.8))
    axes = figure.add_subplot()
    draw_top_view(axes, flight)
    figure.canvas.draw()
    boxes = [t.get_window_extent() for t in axes.texts if t.get_text().startswith("uav")]
    assert len(boxes) == 9
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
