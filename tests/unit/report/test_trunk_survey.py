"""Trunks among crowns and rises of the ground, from a level and a nodding LIDAR."""

from __future__ import annotations

import math

import numpy as np
import pytest
from post_scans import HEIGHT_M, TRUNK, nods_message, scan_message, seen_from

from volery.autonomy.mapping.vertical_structures import VerticalStructures
from volery.core import rotations
from volery.report.trajectories import RecordedTrajectory
from volery.report.trunk_survey import LEVEL, NODDING, TrunkSurvey

S = 1_000_000_000


def surveyed(*, nodding: bool) -> tuple[TrunkSurvey, RecordedTrajectory]:
    """Five seconds to and fro beside the posts."""
    survey, rows = TrunkSurvey(), []
    for k in range(1, 101):
        time_ns = k * S // 20
        position = np.array([0.0, 0.5 * math.sin(0.1 * k), HEIGHT_M])
        rows.append((time_ns / S, *position, *rotations.IDENTITY))
        survey.add_scan(LEVEL, time_ns, scan_message("level", time_ns, seen_from(position, 0.0)))
        if nodding:
            angle = 0.8 * math.sin(0.3 * k)
            survey.add_nods(nods_message(time_ns, angle))
            ranges = seen_from(position, angle)
            survey.add_scan(NODDING, time_ns, scan_message("nodding", time_ns, ranges))
    return survey, RecordedTrajectory.of_rows(rows)


def test_a_crown_in_the_air_is_no_trunk() -> None:
    survey, trajectory = surveyed(nodding=True)
    assert survey.is_founded
    (trunk,) = survey.trunks(trajectory).seen_often
    np.testing.assert_allclose(trunk, [TRUNK.x, TRUNK.y, HEIGHT_M], atol=0.05)


def test_without_a_nodding_lidar_shapes_alone_count() -> None:
    survey, trajectory = surveyed(nodding=False)
    assert not survey.is_founded
    assert len(survey.trunks(trajectory).seen_often) == 2


def test_an_unknown_trajectory_gives_no_trunks() -> None:
    survey, trajectory = surveyed(nodding=True)
    before = RecordedTrajectory.of_rows(
        [(s - 100.0, *p, *a) for s, p, a in zip(*vars(trajectory).values(), strict=True)]
    )
    assert len(survey.trunks(before).positions) == 0


def test_a_rise_of_the_ground_is_no_trunk() -> None:
    """A slope of one in three, a post on it, and a bush."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(0.0, 12.0, 0.2), np.arange(-3.0, 3.0, 0.2)))
    ground = np.stack([x, y, x / 3.0], axis=1)
    height = np.arange(0.0, 3.0, 0.1)
    post = np.stack([np.full(30, 6.0), np.zeros(30), 2.0 + height], axis=1)
    bush = np.stack([np.full(5, 3.0), np.zeros(5), 1.0 + 0.1 * np.arange(5)], axis=1)
    columns = VerticalStructures(np.concatenate([ground, post, bush]))
    assert columns.ground_m(np.array([6.0, 0.0])) == pytest.approx(2.0, abs=0.5)
    assert columns.stands(np.array([6.0, 0.0, 4.5]))
    assert not columns.stands(np.array([9.0, 0.0, 3.0]))
    assert not columns.stands(np.array([3.0, 0.0, 4.0]))
    assert math.isnan(columns.ground_m(np.array([40.0, 0.0])))
    assert not columns.stands(np.array([40.0, 0.0, 4.0]))
