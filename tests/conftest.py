"""Scenarios that many tests fly."""

import copy
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

settings.register_profile("volery", deadline=None)  # busy machines stall for longer than 200 ms
settings.load_profile("volery")

# Tests without sockets, child processes, browsers or a wall clock, marked `pure`: in CI they get no
# second run.
PURE = (
    "e2e/test_determinism.py",
    "e2e/test_equal_flights.py",
    "fuzz/",
    "golden/",
    "oracle/",
    "property/",
    "unit/control/",
    "unit/figures/",
    "unit/logs/",
    "unit/publishing/",
    "unit/report/",
    "unit/results/",
    "unit/scenario/",
    "unit/sensors/",
    "unit/vehicle/",
    "unit/world/",
)


def pytest_collection_modifyitems(items):
    """Marks pure tests by their files and slow tests of the page, and puts the page's tests last.

    From the first of them on, Playwright's event loop runs in the worker's thread, where
    `asyncio.run` of other tests fails.
    """
    tests = Path(__file__).parent
    items.sort(key=lambda item: item.path.is_relative_to(tests / "page"))
    for item in items:
        if item.path.relative_to(tests).as_posix().startswith(PURE):
            item.add_marker("pure")
        if item.path.is_relative_to(tests / "page") and item.get_closest_marker("slow"):
            item.add_marker("browser")


LIDARS = [
    {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
    {
        "kind": "lidar",
        "name": "nodding",
        "position_m": [0.1, 0.0, -0.08],
        "nodding": {"amplitude_deg": 45.0, "period_s": 2.0},
    },
]
OTHERS = [
    {"kind": "imu"},
    {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
    {"kind": "odometry"},
    {"kind": "ground_truth"},
]
FLAT = {
    "name": "flat",
    "types": {"f450": {"sensors": OTHERS}},
    "uavs": [{"type": "f450", "position_m": [0.0, 0.0], "last_position_m": [20.0, 0.0]}],
}
WOOD = {
    "name": "wood",
    "world": {
        "terrain": {"kind": "flat", "extent_m": 100.0},
        "forest": {
            "kind": "procedural",
            "region_m": [0.0, 0.0, 100.0, 100.0],
            "trees": 150,
            "minimum_spacing_m": 2.0,
            "species": {"broadleaf": 1.0},
        },
        "wind": {"velocity_m_s": [1.0, -0.5, 0.0]},
    },
    "types": {
        "surveyor": {
            "sensors": LIDARS + OTHERS,
            "nodes": [
                {
                    "node": "gap_following",
                    "parameters": {
                        "route": [[60.0, 0.0]],
                        "level_mount": [0.0, 0.0, 0.18],
                        "nodding_mount": [0.1, 0.0, -0.08],
                    },
                }
            ],
        }
    },
    "uavs": [
        {
            "type": "surveyor",
            "count": 2,
            "position_m": [15.0, 40.0],
            "last_position_m": [15.0, 60.0],
            "placement": "nearest_free",
        }
    ],
}


@pytest.fixture
def flat_data():
    """A UAV with all small sensors on level ground, as plain data to change."""
    return copy.deepcopy(FLAT)


@pytest.fixture
def wood_data():
    """Two UAVs that cross a small wood on their LIDARs, as plain data to change."""
    return copy.deepcopy(WOOD)


@pytest.fixture
def simulate():
    """Build simulations that are closed at the end of the test."""
    made = []

    def build(data, **options):
        made.append(Simulation(parse_scenario(data), **{"threads": 1, **options}))
        return made[-1]

    yield build
    for simulation in made:
        simulation.close()


@pytest.fixture
def without_ros1(monkeypatch):
    """No message packages of a ROS 1 that other tests have joined in this process."""
    monkeypatch.setattr(sys, "path", [part for part in sys.path if "dist-packages" not in part])
    for name, module in list(sys.modules.items()):
        if "dist-packages" in (getattr(module, "__file__", None) or ""):
            monkeypatch.delitem(sys.modules, name)
