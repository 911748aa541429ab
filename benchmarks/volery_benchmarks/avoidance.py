"""Measures depth-camera avoidance in fields of random obstacles, by two methods.

`region`: `autonomy.avoidance.region_avoidance`, a state machine of four states on the mean depth of
one region. `whole`: `autonomy.avoidance.depth_avoidance`, every pixel, remembered. Both cross the
same fields with the same camera, speed and course of 66 m: `trees` are dead trees (the scenario
`obstacle_field` with other seeds), `blocks` are blocks of 1 m x 1 m x 5 m. A flight ends when the
UAV has landed, touched an obstacle or used two minutes; distances and times are medians over the
flights that arrived.
"""

from __future__ import annotations

import csv
import multiprocessing
import statistics
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from volery.control.flight_modes import FlightMode
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario
from volery_benchmarks.registry import Measured

SEEDS = 50
METHODS = {
    "region": "region_avoidance",
    "whole": "depth_avoidance",
}
FIELDS = ("trees", "blocks")

_COURSE_M = 66.0
_FIELD_M = (8.0, -14.0, 58.0, 14.0)
_BLOCKS = 40
_APART_M = 4.0
"""Min distance between the centers of two blocks, m."""
_SLICE_S = 0.25
_PROCESSES = 2


@dataclass(frozen=True)
class Flight:
    """Holds the outcome of one flight."""

    method: str
    field: str
    seed: int
    touched: bool
    arrived: bool
    metres: float
    seconds: float


def measure(seeds: Sequence[int] = range(1, SEEDS + 1)) -> Measured:
    """Returns collisions, arrivals, metres and seconds, by field and method."""
    tasks = [(method, field, seed) for field in FIELDS for method in METHODS for seed in seeds]
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(_PROCESSES, spawn) as pool:
        flights = list(pool.map(_fly_task, tasks))
    return Measured(figures_of(flights))


def figures_of(flights: Sequence[Flight]) -> dict[str, float]:
    """Returns numbers of collisions and arrivals, medians of distance and time."""
    figures: dict[str, float] = {}
    for field in FIELDS:
        for method in METHODS:
            own = [f for f in flights if (f.field, f.method) == (field, method)]
            arrived = [f for f in own if f.arrived]
            name = f"{field}_{method}"
            figures[f"{name}_collisions"] = sum(f.touched for f in own)
            figures[f"{name}_arrivals"] = len(arrived)
            if arrived:
                figures[f"{name}_metres"] = statistics.median(f.metres for f in arrived)
                figures[f"{name}_seconds"] = statistics.median(f.seconds for f in arrived)
    return figures


def _fly_task(task: tuple[str, str, int]) -> Flight:
    return fly(*task)


def fly(method: str, field: str, seed: int) -> Flight:
    """Crosses one field."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = field_scenario(method, field, seed, Path(folder))
        with Simulation(scenario, threads=1) as simulation:
            uav = simulation.uavs["uav1"]
            positions = [uav.position_map.copy()]
            while not _is_over(simulation):
                simulation.run(_SLICE_S)
                positions.append(uav.position_map.copy())
            metres = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
            touched = any(
                str(event.kind) in ("impact", "collision")
                for event in simulation.diagnostics.events
            )
            arrived = not touched and float(positions[-1][0]) > _COURSE_M - 2.0
            return Flight(method, field, seed, touched, arrived, metres, simulation.time_s)


def _is_over(simulation: Simulation) -> bool:
    uav = simulation.uavs["uav1"]
    landed = uav.mode is FlightMode.LANDED and simulation.time_s > 5.0
    return uav.crashed or landed or simulation.time_s >= simulation.scenario.duration_s


def field_scenario(method: str, field: str, seed: int, folder: Path) -> Scenario:
    """Returns the scenario `obstacle_field` with another seed, node and kind of obstacles.

    Writes the files that the scenario needs into `folder`.
    """
    data: dict[str, Any] = load_scenario("obstacle_field").model_dump()
    data["seed"] = seed
    data["types"]["scout"]["nodes"][0]["node"] = METHODS[method]
    if field == "blocks":
        data["world"]["forest"] = None
        data["world"]["grid_map"] = {
            "maps": [{"file": str(_write_blocks(seed, folder))}],
            "block_height_m": 5.0,
            "origin_m": _FIELD_M[:2],
        }
    return Scenario.model_validate(data)


def _write_blocks(seed: int, folder: Path) -> Path:
    """Writes a map of 1 m cells with random blocks that keep a min distance."""
    x0, y0, x1, y1 = _FIELD_M
    cells = np.zeros((round(y1 - y0), round(x1 - x0)), dtype=int)
    rng = np.random.default_rng(seed)
    chosen: list[np.ndarray[Any, Any]] = []
    while len(chosen) < _BLOCKS:
        cell = rng.integers((0, 0), cells.shape)
        if all(np.hypot(*(cell - other)) >= _APART_M for other in chosen):
            chosen.append(cell)
            cells[tuple(cell)] = 1
    path = folder / "blocks.csv"
    with path.open("w", newline="", encoding="ascii") as file:
        csv.writer(file).writerows(cells)
    return path
