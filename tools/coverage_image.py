"""Draws a coverage plan: areas and tours.

python tools/coverage_image.py docs/pictures/coverage.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from volery.autonomy.coverage.plan import CoveragePlan, plan_coverage
from volery.core.plurals import counted
from volery.figures.palette import uav_color
from volery.world.grid_maps.parsing import read_cells

_MAP = Path(__file__).parent.parent / "world/data/gridmaps/random-32-32-10.map"
_STARTS = [(1, 1), (1, 11), (1, 20), (1, 30)]
"""Start cells near those of the scenario `coverage`."""
_BLOCKED = "#5a5a5a"


def draw_plan(plan: CoveragePlan, free: NDArray[np.bool_], starts: list[tuple[int, int]]) -> Figure:
    """Draws areas as tints, tours as lines, starts as dots; one unit is a cell."""
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    axes = figure.add_subplot()
    picture = np.ones((*free.shape, 3))
    picture[~free] = to_rgb(_BLOCKED)
    for uav, route in enumerate(plan.routes):
        colour = to_rgb(uav_color(uav))
        picture[plan.owner == uav] = 0.25 * np.array(colour) + 0.75
        for tour in route:
            closed = np.vstack([tour.sub_cells, tour.sub_cells[:1]])
            axes.plot(*((closed[:, ::-1] + 0.5) / 2.0).T, color=colour, lw=1.1)
        row, column = starts[uav]
        label = f"uav{uav + 1}: {counted(int(plan.shares[uav]), 'cell')}"
        axes.plot(column + 0.5, row + 0.5, "o", color=colour, mec="black", ms=9, label=label)
    axes.imshow(picture, origin="lower", extent=(0, free.shape[1], 0, free.shape[0]))
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    figure.legend(loc="outside lower center", ncols=len(plan.routes), frameon=False)
    return figure


if __name__ == "__main__":
    field = ~read_cells(_MAP)
    draw_plan(plan_coverage(field, _STARTS), field, _STARTS).savefig(sys.argv[1], dpi=110)
