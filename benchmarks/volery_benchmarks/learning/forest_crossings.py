"""Counts crossings of forests that no training has seen: by the policy, and by hand-written nodes.

A crossing succeeds without a contact on 60 m, at 3 m/s or faster. The node `gap_following` crosses
the same forests in the full simulation, with its own sensors: two LIDARs with 1,081 beams at 40 Hz,
a sonar and odometry. Its mean speed is that of the 60 m.
"""

from __future__ import annotations

import multiprocessing
import statistics
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from volery.autonomy.policy.policy_file import Policy
from volery.autonomy.policy.shipped_policies import load_policy
from volery.learning.episodes import Episodes
from volery.learning.tasks.forest import LENGTH_M, UNSEEN_WORLDS, forest, forest_scenario
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

_TIME_LIMIT_S = 60.0
_SLICE_S = 0.1
_PROCESSES = 2


@dataclass(frozen=True)
class Crossing:
    """Outcome of one flight."""

    world: int
    """Seed of the forest."""
    crossed: bool
    """Whether the UAV came across without a contact."""
    speed_m_s: float
    """Mean speed on the way across; 0 if it did not come across."""

    @property
    def is_success(self) -> bool:
        """Whether it came across at 3 m/s or faster."""
        return self.crossed and self.speed_m_s >= 3.0


def forest_crossings(
    policy: Policy | None = None, worlds: Sequence[int] = UNSEEN_WORLDS, *, threads: int = 2
) -> list[Crossing]:
    """Returns one crossing of each forest by a policy, by default the one that ships."""
    policy = policy or load_policy("forest")
    task = forest().in_unseen_worlds()
    numbers = np.array([task.worlds.index(world) for world in worlds])
    episodes = Episodes(task, len(worlds), seed=1 << 20, threads=threads)
    everyone = np.arange(len(worlds))
    seconds = np.zeros(len(worlds))
    try:
        episodes.begin(everyone, worlds=numbers)
        while (seconds == 0.0).any():
            action = policy.network.act(episodes.observe(everyone))
            outcome = episodes.decide(action)
            over = (outcome.terminated | outcome.truncated) & (seconds == 0.0)
            now = episodes.flight.decisions[over] / task.decision_rate_hz
            seconds[over] = np.where(outcome.success[over], now, np.inf)
    finally:
        episodes.close()
    return [
        Crossing(world, bool(np.isfinite(time)), LENGTH_M / float(time))
        for world, time in zip(worlds, seconds, strict=True)
    ]


def node_crossings(worlds: Sequence[int], speed_m_s: float = 3.0) -> list[Crossing]:
    """Returns one crossing of each forest by the node `gap_following`."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(_PROCESSES, spawn) as pool:
        return list(pool.map(_fly, worlds, [speed_m_s] * len(worlds)))


def figures_of(crossings: Sequence[Crossing], name: str) -> dict[str, float]:
    """Returns the fractions of crossings that succeed and that end without a contact, and speed."""
    speeds = [crossing.speed_m_s for crossing in crossings if crossing.crossed]
    figures = {
        f"success_{name}": statistics.mean(crossing.is_success for crossing in crossings),
        f"crossed_{name}": statistics.mean(crossing.crossed for crossing in crossings),
    }
    if speeds:
        figures[f"speed_m_s_{name}"] = statistics.median(speeds)
    return figures


def _fly(world: int, speed_m_s: float) -> Crossing:
    """Flies 60 m along the x axis; the time counts from the start of the forest side."""
    data = forest_scenario().model_dump(mode="json", exclude_unset=True)
    data["types"] = {
        "surveyor": {
            "airframe": "f450",
            "flight": {"take_off_altitude_m": 2.0},
            "sensors": [
                {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
                {
                    "kind": "lidar",
                    "name": "nodding",
                    "position_m": [0.10, 0.0, -0.08],
                    "nodding": {"amplitude_deg": 45.0, "period_s": 1.0},
                },
                {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
                {"kind": "odometry"},
            ],
            "nodes": [
                {
                    "node": "gap_following",
                    "parameters": {
                        "route": [[LENGTH_M + 10.0, 0.0]],
                        "height_m": 2.0,
                        "speed_m_s": speed_m_s,
                        "level_mount": [0.0, 0.0, 0.18],
                        "nodding_mount": [0.10, 0.0, -0.08],
                    },
                }
            ],
        }
    }
    data["uavs"] = [{"type": "surveyor", "position_m": [-4.0, 0.0]}]
    data["world"]["seed"] = world
    with Simulation(parse_scenario(data), threads=1) as simulation:
        uav, began_s = simulation.uavs["uav1"], None
        while simulation.time_s < _TIME_LIMIT_S and not _has_touched(simulation):
            simulation.run(_SLICE_S)
            x = float(uav.position_map[0])
            if began_s is None and x >= 0.0:
                began_s = simulation.time_s
            if began_s is not None and x >= LENGTH_M:
                return Crossing(world, True, LENGTH_M / (simulation.time_s - began_s))
    return Crossing(world, False, 0.0)


def _has_touched(simulation: Simulation) -> bool:
    kinds = {str(event.kind) for event in simulation.diagnostics.events}
    return bool(kinds & {"impact", "collision"})
