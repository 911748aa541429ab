"""Cross 60 m of a dense forest at 3 m/s or faster, by a planar LIDAR: OpenUAV's third task.

Each episode takes place in one of 256 stands of longleaf pine with 500 trees per hectare: 400 on
60 m by 133 m. Their trunks are 2 to 80 cm thick; few have branches at the height of the flight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.learning.actions import LevelVelocity
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms import lines, observations, rewards, terminations
from volery.learning.terms.lines import LINE
from volery.learning.terms.sensor_observations import lidar_sectors
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario

LENGTH_M = 60.0
SPEED_M_S = 3.0
HEIGHT_M = 2.0
_HALF_WIDTH_M = 66.6
"""Half the width of the forest."""
_SIDE_M = 45.0
"""Largest distance of a start from the middle."""
_TURN_RAD = math.radians(10.0)
TRAINING_WORLDS = tuple(range(1000, 1256))
UNSEEN_WORLDS = tuple(range(5000, 5200))
_SECTORS = lidar_sectors(
    sectors=36, angle_min_rad=-0.75 * math.pi, angle_max_rad=0.75 * math.pi, max_range_m=10.0
)


def forest() -> Task:
    """Returns the task."""
    return Task(
        "forest",
        "Cross 60 m of a dense forest at 3 m/s or faster, by a planar LIDAR",
        scenario=forest_scenario,
        action=LevelVelocity(forward_m_s=3.25, lateral_m_s=2.5, keep_height_m=HEIGHT_M),
        observations=(
            _SECTORS,
            observations.velocity_heading(SPEED_M_S, noise=0.05),
            lines.line_offset(10.0),
            observations.last_action(2),
        ),
        rewards=(
            lines.progress(0.3, 1.04 * SPEED_M_S),
            lines.too_slow(-0.03, SPEED_M_S),
            lines.clearance(-0.5, _SECTORS, near=0.87),
            rewards.action_change(-0.05),
        ),
        terminations=(lines.crossed(LENGTH_M, 3.0), terminations.crashed(-20.0)),
        begin=_begin,
        decision_rate_hz=10.0,
        episode_s=LENGTH_M / SPEED_M_S,
        action_latency_s=0.02,
        values={LINE: (1, 4)},
        worlds=TRAINING_WORLDS,
        unseen_worlds=UNSEEN_WORLDS,
    )


def forest_scenario() -> Scenario:
    """Returns the scenario: an F450 with a LIDAR, whose sweeps end at the decisions."""
    return parse_scenario(
        {
            "name": "forest_strip",
            "physics": {"rate_hz": 500, "guidance_rate_hz": 100},
            "world": {
                "terrain": {"kind": "flat", "extent_m": 100.0},
                "forest": {
                    "kind": "procedural",
                    "region_m": [3.0, -_HALF_WIDTH_M, 3.0 + LENGTH_M, _HALF_WIDTH_M],
                    "trees": 400,
                    "minimum_spacing_m": 2.5,
                    "species": {"longleaf_pine": 1.0},
                },
            },
            "types": {
                "scout": {
                    "airframe": "f450",
                    "sensors": [
                        {
                            "kind": "lidar",
                            "name": "horizontal",
                            "model": "planar_270",
                            "position_m": [0.0, 0.0, 0.1],
                            "phase_s": 0.09,
                        }
                    ],
                }
            },
            "uavs": [{"type": "scout", "position_m": [0.0, 0.0, HEIGHT_M]}],
        }
    )


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    drawn = flight.draws.uniform(envs, [-_SIDE_M, -1.0], [_SIDE_M, 1.0], (1, 2))
    side, turn = drawn[..., 0], _TURN_RAD * drawn[..., 1]
    nothing = np.zeros_like(side)
    ahead = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    line = np.stack([nothing, side, ahead[..., 0], ahead[..., 1]], axis=-1)
    flight.values[LINE][envs] = line
    position = np.stack([nothing, side, nothing + HEIGHT_M], axis=-1)
    return EnvironmentStart(position, rotations.from_rpy(nothing, nothing, turn))
