"""Figures of the forest search from synthetic flights, whose results are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from volery.core.errors import VoleryError
from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message
from volery.report.trunk_survey import LEVEL
from volery_benchmarks.forest_flight import SIGHT_M, Flown, Search, area_of, search_scenario
from volery_benchmarks.forest_search import figures_of
from volery_benchmarks.registry import find

TREES = np.array([[30.0, 250.0], [34.0, 260.0], [200.0, 430.0]])
STANDING = np.concatenate([TREES, [[60.0, 252.0]]])
"""What looks like a trunk; the last one is none of the forest's trees."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def flown(start_x: float, y: float, *, off: float = 0.0, seconds: float = 60.0) -> Flown:
    """East at 2 m/s; the estimate is `off` to the north, and a tree in sight is scanned."""
    uav = Flown()
    for k in range(round(10 * seconds) + 1):
        t = k / 10.0
        position = np.array([start_x + 2.0 * t, y])
        uav.truth.append((t, *position, 3.0, *UPRIGHT))
        uav.estimate.append((t, position[0], position[1] + off, 3.0, *UPRIGHT))
        if k % 5 == 2:
            uav.survey.add_scan(
                LEVEL, k * 100_000_000, scan_of(k * 100_000_000, STANDING - position)
            )
    return uav


def scan_of(time_ns: int, posts: np.ndarray) -> Any:
    """What a scanner sees that turns as fast as it likes, of posts with 0.2 m radius."""
    scan = zero_message("sensor_msgs/msg/LaserScan")
    scan.header = m.header(time_ns, "laser")
    scan.angle_min, scan.angle_increment = -math.pi, math.radians(0.25)
    angles = scan.angle_min + scan.angle_increment * np.arange(1440)
    ranges = np.full(1440, np.inf, np.float32)
    for post in posts:
        along = post @ [np.cos(angles), np.sin(angles)]
        aside = np.abs(post @ [-np.sin(angles), np.cos(angles)])
        hit = (aside < 0.2) & (along > 0.0) & (along < 12.0)
        ranges[hit] = along[hit] - np.sqrt(0.04 - aside[hit] ** 2)
    scan.ranges = ranges
    return scan


def search_of(uavs: dict[str, Flown], wall_s: float = 30.0, collisions: int = 0) -> Search:
    scenario = search_scenario(len(uavs), 1, 60.0)
    return Search(scenario, uavs, wall_s, 60.0, collisions, TREES)


def test_the_area_is_that_of_the_task_managers() -> None:
    assert area_of(search_scenario(2, 1, 10.0)) == (20.0, 240.0, 220.0, 440.0)


def test_what_was_searched_is_a_band_along_the_path() -> None:
    search = search_of({"uav1": flown(40.0, 300.0)})
    band = 120.0 * 2.0 * SIGHT_M + math.pi * SIGHT_M**2
    assert search.searched_m2() == pytest.approx(band, rel=0.06)
    assert search.searched_m2(30.0) == pytest.approx(60.0 * 12.0 + math.pi * 36.0, rel=0.06)
    twice = search_of({"uav1": flown(40.0, 300.0), "uav2": flown(40.0, 300.0)})
    assert twice.searched_m2() == search.searched_m2()
    beside = search_of({"uav1": flown(40.0, 235.0)})  # the area begins at 240
    assert beside.searched_m2() < 0.2 * band


def test_errors_of_poses_and_of_trunks() -> None:
    search = search_of({"uav1": flown(24.0, 254.0, off=0.7)})
    assert search.ate_rmse_m()["uav1"] == pytest.approx(0.0, abs=1e-6)  # moved as a whole
    offset = np.hypot(26.0, 8.0)  # from the post to the nearest tree, 0.7 m north as it is reported
    np.testing.assert_allclose(search.trunk_errors_m()[:2], [0.7, 0.7], atol=0.05)
    np.testing.assert_allclose(search.trunk_errors_m(aligned=True), [0.0, 0.0, offset], atol=0.06)
    assert search.distances_m()["uav1"] == pytest.approx(120.0)


def test_a_target_counts_from_the_first_list_to_the_last() -> None:
    one, two = flown(40.0, 300.0), flown(40.0, 350.0)
    cube = np.array([[61.5, 269.0]])
    both = np.array([[61.5, 269.0], [100.0, 100.0]])
    one.targets = [(5.0, cube), (9.0, both)]
    two.targets = [(5.4, cube + 0.5), (10.5, both)]
    search = search_of({"uav1": one, "uav2": two})
    assert search.target_delays_s() == pytest.approx([0.4, 1.5])
    assert search.target_errors_m() == pytest.approx([0.5])  # the other is none of the hidden ones
    two.targets.pop()
    assert search.target_delays_s()[1] == math.inf


def test_figures_of_a_team_and_one() -> None:
    ys = (258.0, 320.0, 380.0)
    team = [
        search_of({f"uav{k + 1}": flown(40.0, y) for k, y in enumerate(ys)}, 30.0 + 10.0 * n, n)
        for n in range(3)
    ]
    measured = figures_of(team, [search_of({"uav1": flown(40.0, 258.0)})])
    figures = measured.figures
    assert figures["realtime_factor"] == pytest.approx(1.5)
    assert figures["realtime_factor_worst"] == pytest.approx(1.2)
    assert figures["collisions"] == 3.0
    assert figures["searched_three_to_one"] == pytest.approx(3.0)
    assert figures["ate_rmse_m_worst"] == pytest.approx(0.0, abs=1e-6)
    assert figures["trunks"] == 6.0  # a tree and the post, three times
    assert figures["trunks_within_half_m"] == 0.5
    assert measured.failures == {"target_delay_s_worst": "no target was found"}


def test_quick_is_for_benches_that_can() -> None:
    with pytest.raises(VoleryError, match="bench fleet has no --quick"):
        find("fleet").run(quick=True)
