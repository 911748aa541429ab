"""Maps of flying scanners: the ground is no obstacle."""

from __future__ import annotations

import dataclasses

import numpy as np
from post_scans import CROWN, HEIGHT_M, TRUNK, scan_message, seen_from

from volery.autonomy.mapping.log_odds import OCCUPIED
from volery.autonomy.perception.static_transforms import LEVEL
from volery.core import rotations
from volery.runtime.replay.slam.map_rendering import draw_map
from volery.runtime.replay.slam.offline_slam import SlamResult
from volery.runtime.replay.slam.topic_selection import TopicSelection
from volery.runtime.replay.slam.trajectory import EstimatedTrajectory

S = 1_000_000_000


def flown() -> SlamResult:
    """Five seconds beside a trunk and a crown, towards a slope that the level scan meets."""
    times = np.arange(1, 101) * (S // 20)
    positions = np.stack(
        [np.zeros(100), 0.5 * np.sin(0.1 * np.arange(100)), np.full(100, HEIGHT_M)]
    )
    angles = 0.8 * np.sin(0.3 * np.arange(100))
    level, nodding = [], []
    for k, (position, angle) in enumerate(zip(positions.T, angles, strict=True)):
        when = int(times[k])
        level.append((k, scan_message("level", when, seen_from(position, 0.0))))
        nodding.append((k, scan_message("laser_nodding", when, seen_from(position, angle))))
    return SlamResult(
        TopicSelection("uav1", {}, True),
        EstimatedTrajectory(times, times, positions.T, np.tile(rotations.IDENTITY, (100, 1))),
        [scan for scan in level if scan[0] % 10 == 0],
        lambda _: LEVEL,
        100, 5.0, 0.1, {}, nodding=nodding, nods=np.stack([times / S, angles], 1),
    )  # fmt: skip


def occupied(outcome: SlamResult) -> np.ndarray:
    """Middles (N, 2) of what the map takes for obstacles."""
    grid = draw_map(outcome, 0.1, 40.0)
    rows, columns = np.nonzero(grid.occupancy() == OCCUPIED)
    return grid.origin + (np.stack([columns, rows], axis=1) + 0.5) * grid.cell_m


def test_ground_that_rises_into_the_scan_is_no_obstacle() -> None:
    outcome = flown()
    without = occupied(dataclasses.replace(outcome, nodding=[]))
    assert (without[:, 0] > 20.0).sum() > 20  # where the slope reaches 3 m
    found = occupied(outcome)
    away = [np.hypot(*(found - [post.x, post.y]).T) for post in (TRUNK, CROWN)]
    assert np.minimum(*away).max() < 0.5
    assert min(map(np.min, away)) < 0.3
