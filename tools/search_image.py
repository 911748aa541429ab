"""Runs the scenario `cooperative_search` and draws paths, detection and meeting positions.

python tools/search_image.py docs/pictures/cooperative_search.png
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from volery.figures.flight_data import Trees
from volery.figures.palette import uav_color
from volery.figures.trees import trees_of
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

_PERIOD_S = 0.2
_AFTER = ("come", "hold", "home", "over_home", "land", "done")


@dataclass
class RecordedSearch:
    """Data of one flight to draw."""

    ways: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """Path of each UAV during its search."""
    calls: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """Path of each UAV from the end of its search to its position at the object."""
    found: tuple[float, float] | None = None
    finder: str = ""
    found_s: float = 0.0
    trees: Trees | None = None


def fly(scenario: Scenario) -> RecordedSearch:
    """Runs the scenario until all UAVs have met."""
    told, phases = RecordedSearch(), dict[str, str]()

    def on_found(name: str, published: Any) -> None:
        if told.found is None:
            point = published.message.point
            told.found, told.finder = (point.x, point.y), name
            told.found_s = published.time_ns * 1e-9

    with Simulation(scenario) as simulation:
        for name in simulation.uavs:
            graph, below = simulation.graph, f"/{name}/search"
            graph.subscribe(f"{below}/found", lambda p, name=name: on_found(name, p))  # type: ignore[misc]
            graph.subscribe(
                f"{below}/state",
                lambda p, name=name: phases.update({name: p.message.phase}),  # type: ignore[misc]
            )
            told.ways[name], told.calls[name] = [], []
        told.trees = trees_of(simulation.world.forest)
        while not simulation.clock.finished and not _have_met(phases):
            simulation.run(_PERIOD_S)
            for name, uav in simulation.uavs.items():
                x, y, _ = uav.position_map
                way = told.calls if phases.get(name) in _AFTER else told.ways
                way[name].append((float(x), float(y)))
    return told


def draw(search: RecordedSearch, scenario: Scenario) -> Figure:
    """Draws the area from above."""
    figure = Figure(figsize=(8.0, 6.4), layout="constrained")
    axes = figure.add_subplot()
    x_min, y_min, x_max, y_max = _area_of(scenario)
    size = x_max - x_min, y_max - y_min
    axes.add_patch(Rectangle((x_min, y_min), *size, fc="#f3f1e6", ec="#777777", ls="--"))
    if search.trees is not None:
        feet, radii = search.trees.position_map, search.trees.crown_radius_m
        for (x, y, _), radius in zip(feet, radii, strict=True):
            axes.add_patch(Circle((x, y), radius, fc="#a9c99a", ec="none"))
    for number, name in enumerate(search.ways):
        colour = uav_color(number)
        way, call = np.array(search.ways[name]), np.array(search.calls[name])
        axes.plot(*way.T, color=colour, lw=1.4, label=f"{name} searches")
        axes.plot(*np.vstack([way[-1:], call]).T, color=colour, lw=2.0, ls=":")
        axes.plot(*way[0], "s", color=colour, mec="black", ms=7)
        axes.plot(*call[-1], "o", color=colour, mec="black", ms=8)
    axes.plot([], [], color="black", ls=":", lw=2.0, label="comes")
    if search.found is not None:
        label = f"found by {search.finder} after {search.found_s:.0f} s"
        axes.plot(*search.found, "X", color="#d62728", mec="black", ms=12, label=label)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_aspect("equal")
    axes.margins(0.02)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _have_met(phases: Mapping[str, str]) -> bool:
    return bool(phases) and all(phase == "hold" for phase in phases.values())


def _area_of(scenario: Scenario) -> list[float]:
    (node,) = scenario.types["searcher"].nodes
    return [float(value) for value in node.parameters["area_m"]]


if __name__ == "__main__":
    meadow = load_scenario("cooperative_search")
    draw(fly(meadow), meadow).savefig(sys.argv[1], dpi=110)
