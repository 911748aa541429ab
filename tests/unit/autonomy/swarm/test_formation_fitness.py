"""The fitness of formations: a V is best, and every part is what its definition says."""

import math

import numpy as np
import pytest

from volery.autonomy.swarm.formation_fitness import (
    BEST_ASIDE,
    BEST_BEHIND,
    formation_fitness,
)
from volery.autonomy.swarm.particle_swarm import approach_margin
from volery.core.errors import PlanError


def v_of(count, angle=0.0):
    """A V that flies along +y, turned by `angle`; the middle bird leads."""
    rank = np.arange(count) - count // 2
    positions = np.stack([rank * BEST_ASIDE, -np.abs(rank) * BEST_BEHIND], axis=1)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return positions @ turn.T, np.tile(turn @ [0.0, 0.5], (count, 1))


@pytest.mark.parametrize("count", [1, 2, 7, 8, 30])
@pytest.mark.parametrize("angle", [0.0, 1.0, math.pi])
def test_a_v_costs_nothing(count, angle):
    positions, speeds = v_of(count, angle)
    found = formation_fitness(positions + np.array([40.0, -7.0]), speeds)
    assert found.cost == pytest.approx(0.0, abs=1e-9)
    assert found.upwash == pytest.approx(count - 1)


def expected(positions, speeds):
    """The definitions of the paper, pair by pair, with angles instead of cross products."""
    matching = view = upwash = 0.0
    for i, (p, v) in enumerate(zip(positions, speeds, strict=True)):
        benefit = 0.0
        for j, (q, u) in enumerate(zip(positions, speeds, strict=True)):
            if i == j:
                continue
            norms = np.linalg.norm(v) + np.linalg.norm(u)
            matching += 0.5 * (np.linalg.norm(v - u) / norms) ** 2
            bearing = math.atan2(*(q - p)[::-1]) - math.atan2(*v[::-1])
            far = math.hypot(*(q - p))
            ahead, aside = far * math.cos(bearing), abs(far * math.sin(bearing))
            if ahead < 0.0:
                continue
            inner, outer = math.atan2(ahead, aside - 1.0), math.atan2(ahead, aside + 1.0)
            inner, outer = min(inner, math.radians(120)), max(outer, math.radians(60))
            view += max(0.0, inner - outer) / math.radians(30)
            smooth = math.erf(8.0 * math.sqrt(2.0) * (aside - (0.5 + math.pi / 8)))
            if aside >= 0.5 + math.pi / 8:
                square = (aside - (1.5 + math.pi / 8)) ** 2 + (ahead - 1.0) ** 2
                cosine = v @ u / (np.linalg.norm(v) * np.linalg.norm(u))
                benefit += cosine * smooth * math.exp(-2.5 * square)
            else:
                benefit += smooth * math.exp(-0.5 * (aside**2 / 0.3 + ahead**2 / 0.7))
        upwash += min(1.0, benefit)
    return matching, view, upwash, matching**2 + view**2 + (len(positions) - 1 - upwash) ** 2


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_those_of_the_definition(seed):
    rng = np.random.default_rng(seed)
    positions, speeds = rng.uniform(0.0, 5.0, (9, 2)), rng.uniform(-0.75, 0.75, (9, 2))
    assert formation_fitness(positions, speeds) == pytest.approx(
        expected(positions, speeds), abs=1e-9
    )


def test_a_bird_straight_ahead_blocks_the_view_and_pushes_down():
    behind = formation_fitness([[0.0, 0.0], [0.0, 1.0]], [[0.0, 1.0]] * 2)
    assert behind.clear_view == pytest.approx(2.0)
    assert behind.upwash < 0.0
    beside = formation_fitness([[0.0, 0.0], [5.0, 0.1]], [[0.0, 1.0]] * 2)
    assert beside.clear_view == 0.0


def test_birds_that_stand_have_no_heading():
    found = formation_fitness([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0]] * 2)
    assert found[:3] == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("positions", "speeds"),
    [([[0.0, 0.0]], [[0.0]]), ([], []), ([[0.0, math.nan]], [[0.0, 1.0]]), ([1.0], [1.0])],
)
def test_other_shapes_and_values_are_refused(positions, speeds):
    with pytest.raises(PlanError, match=r"\(N, 2\)|finite"):
        formation_fitness(positions, speeds)


@pytest.mark.parametrize("min_distance", [0.5, 1.5, 100.0])
def test_the_margin_is_that_of_the_whole_path(min_distance):
    """Two birds nearer than `min_distance` must not approach."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        before, after = rng.uniform(-3.0, 3.0, (2, 4, 5))
        tracks = before[:2] + np.linspace(0, 1, 2001)[:, None, None] * (after[:2] - before[:2])
        apart = np.linalg.norm(tracks[:, :, :, None] - tracks[:, :, None, :], axis=1)
        margins = apart.min(axis=0) - np.minimum(min_distance, apart[0]) + 99.0 * np.eye(5)
        assert approach_margin(before, after, min_distance) == pytest.approx(
            margins.min(), abs=0.01
        )
