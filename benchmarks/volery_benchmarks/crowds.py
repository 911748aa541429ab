"""Situations in which UAVs must avoid each other, flown by the node `flock` in full physics.

A run is free of collisions if no UAV touches another one or a tree until all have arrived.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import WaitTimeoutError
from volery.core.machine import usable_cores
from volery.graph.messages import Published
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

_LOG = logging.getLogger(__name__)
_TAKE_OFF_S, _FLIGHT_S = 10.0, 150.0
_HEIGHT_M = 5.0
_ARRIVED_M = 1.5


class Crowd(NamedTuple):
    """Describes a run before it begins; positions are m in the map."""

    start: Array
    """(N, 2)"""
    goal: Array
    """(N, 2)"""
    height_m: float = _HEIGHT_M
    forest: dict[str, Any] | None = None
    """Section `world.forest`; UAVs then have a LIDAR."""


class CrowdFlight(NamedTuple):
    """Result of a run."""

    crashed: int
    """UAVs that touched something."""
    arrived: bool
    """Whether all others arrived."""
    seconds: float
    """Until then, from the first command; the limit if they did not."""
    min_distance_m: float
    """Between two UAVs, once a second."""


def circle_swap(seed: int) -> Crowd:
    """50 UAVs on a circle of 35 m, each of which flies to the opposite point."""
    rng = np.random.default_rng(seed)
    turn = 2.0 * np.pi * (np.arange(50) + rng.uniform(-0.2, 0.2, 50)) / 50
    start = 35.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return Crowd(start, -start)


def crossing_streams(seed: int) -> Crowd:
    """Two blocks of 50 UAVs, 3 m apart, whose paths cross at a right angle."""
    rng = np.random.default_rng(seed)
    block = 3.0 * np.stack(np.meshgrid(np.arange(5), np.arange(10)), axis=-1).reshape(-1, 2)
    block = block - block.mean(axis=0)
    east = block + np.array([-40.0, 0.0]) + rng.uniform(-0.4, 0.4, block.shape)
    north = block[:, ::-1] + np.array([0.0, -40.0]) + rng.uniform(-0.4, 0.4, block.shape)
    start = np.vstack((east, north))
    goal = np.vstack((east + np.array([80.0, 0.0]), north + np.array([0.0, 80.0])))
    return Crowd(start, goal)


def forest_passage(seed: int) -> Crowd:
    """30 UAVs through 60 m of forest with 250 trees per hectare, by their LIDARs."""
    rng = np.random.default_rng(seed)
    rows = 4.0 * np.stack(np.meshgrid(np.arange(3), np.arange(10)), axis=-1).reshape(-1, 2)
    start = rows - np.array([14.0, 18.0]) + rng.uniform(-0.4, 0.4, rows.shape)
    forest = {
        "kind": "procedural",
        "region_m": [3.0, -40.0, 63.0, 40.0],
        "trees": 120,
        "minimum_spacing_m": 3.5,
        "species": {"longleaf_pine": 1.0},
    }
    return Crowd(start, start + np.array([85.0, 0.0]), 2.0, forest)


SITUATIONS: dict[str, Callable[[int], Crowd]] = {
    "circle_swap": circle_swap,
    "crossing_streams": crossing_streams,
    "forest_passage": forest_passage,
}


def fly_all(situation: str, behaviour: str, runs: int) -> list[CrowdFlight]:
    """Returns the results of runs with different seeds, as many at once as there are cores."""
    seeds = range(1, runs + 1)
    context, flights = multiprocessing.get_context("spawn"), list[CrowdFlight]()
    with ProcessPoolExecutor(min(usable_cores(), runs), context) as pool:
        fly_seed = partial(_fly_seed, situation, behaviour)
        for seed, flight in zip(seeds, pool.map(fly_seed, seeds), strict=True):
            flights.append(flight)
            _LOG.info("%s, %s, seed %d: %s", situation, behaviour, seed, flight)
    return flights


def _fly_seed(situation: str, behaviour: str, seed: int) -> CrowdFlight:
    return fly(SITUATIONS[situation](seed), behaviour, seed)


def fly(crowd: Crowd, behaviour: str, seed: int) -> CrowdFlight:
    """Flies a run until all UAVs in the air have arrived."""
    scenario = parse_scenario(_scenario(crowd, behaviour, seed), where="crowd")
    status: dict[str, Any] = {}
    min_distance_m = np.inf
    with Simulation(scenario, threads=1) as simulation:

        def on_status(published: Published) -> None:
            nonlocal min_distance_m
            status.update(json.loads(published.message.data))
            min_distance_m = min(min_distance_m, status["least_distance_m"] or np.inf)

        simulation.graph.subscribe("/flock/status", on_status)
        simulation.run_until(lambda: bool(status), _TAKE_OFF_S)
        begun = simulation.time_s
        try:
            simulation.run_until(lambda: status["arrived"] == status["members"], _FLIGHT_S)
            arrived = True
        except WaitTimeoutError:
            arrived = False
        crashed = int(simulation.vehicles.state().crashed.sum())
        return CrowdFlight(crashed, arrived, simulation.time_s - begun, min_distance_m)


def _scenario(crowd: Crowd, behaviour: str, seed: int) -> dict[str, Any]:
    sensors: list[dict[str, Any]] = [
        {"kind": "imu"},
        {"kind": "odometry", "noise": False},
    ]
    parameters: dict[str, Any] = {
        "uavs": "{uavs}",
        "behaviour": behaviour,
        "height_m": crowd.height_m,
        "goals_m": crowd.goal.tolist(),
        "arrival_m": _ARRIVED_M,
    }
    world: dict[str, Any] = {
        "seed": seed,
        "terrain": {"kind": "flat", "extent_m": 300.0},
        "wind": {"velocity_m_s": [1.5, 1.0, 0.0]},
    }
    if crowd.forest is not None:
        world["forest"] = crowd.forest
        sensors.append({"kind": "lidar", "name": "horizontal", "model": "planar_270"})
        parameters["scan"] = "laser/horizontal/scan"
    return {
        "name": "crowd",
        "seed": seed,
        "world": world,
        "types": {
            "scout": {
                "airframe": "f450",
                "flight": {"take_off_altitude_m": crowd.height_m},
                "sensors": sensors,
            }
        },
        "nodes": [{"node": "flock", "parameters": parameters}],
        "uavs": [
            {"type": "scout", "position_m": position, "on_start": "take_off"}
            for position in crowd.start.tolist()
        ],
    }
