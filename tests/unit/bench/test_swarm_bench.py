"""Figures of the bench `swarm` from flights made up here, and from one of four UAVs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from volery.core.errors import VoleryError
from volery_benchmarks import crowds, formation_games, swarm
from volery_benchmarks.crowds import Crowd, CrowdFlight
from volery_benchmarks.registry import BENCHES, find


@pytest.fixture(name="flown")
def _flown(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int]]:
    """Situation, behaviour and runs of all crowds that the bench flies; none is flown."""
    flown: list[tuple[str, str, int]] = []

    def fly_all(situation: str, behaviour: str, runs: int) -> list[CrowdFlight]:
        flown.append((situation, behaviour, runs))
        return [
            CrowdFlight(2, False, 150.0, 0.4),
            CrowdFlight(1, True, 31.0, 0.9),
            CrowdFlight(0, True, 30.0, 2.1),
            CrowdFlight(0, True, 29.0, 2.0),
        ]

    monkeypatch.setattr(crowds, "fly_all", fly_all)
    monkeypatch.setattr(formation_games, "play", lambda games: {"games_won": float(games)})
    return flown


def test_a_crowd_has_four_figures_for_each_behaviour(flown: list[Any]) -> None:
    figures = find("swarm").run(only=("circle_swap",)).figures
    assert flown == [
        ("circle_swap", "orca", 100),
        ("circle_swap", "trajectories", 100),
        ("circle_swap", "vasarhelyi", 10),
        ("circle_swap", "olfati_saber", 10),
    ]
    assert len(figures) == 16
    of_orca = {name[17:]: figure for name, figure in figures.items() if "_orca_" in name}
    assert of_orca == {
        "collisions": 2.0,  # runs with one, not UAVs
        "arrived": 0.75,
        "s_median": 30.5,
        "least_distance_m": 0.4,
    }


def test_quick_flies_each_crowd_once_and_plays_two_games(flown: list[Any]) -> None:
    only = ("crossing_streams", "games", "forest_passage")
    figures = find("swarm").run(quick=True, only=only).figures
    assert [runs for _, _, runs in flown] == [1] * 8
    assert figures["games_won"] == 2.0
    assert len(figures) == 33


def test_parts_that_do_not_exist_are_refused(flown: list[Any]) -> None:
    with pytest.raises(VoleryError, match="bench swarm has no part 'none': plans, flights, games"):
        swarm.measure(only=["circle_swap", "none"])
    assert not flown


def test_every_bound_of_a_crowd_is_that_of_a_figure(flown: list[Any]) -> None:
    figures = find("swarm").run(only=tuple(crowds.SITUATIONS)).figures
    bounds = [name for name in BENCHES["swarm"].bounds if name.endswith("_collisions")]
    assert len(bounds) == len({situation for situation, _, _ in flown}) == 3
    assert set(bounds) <= set(figures)


def test_a_crowd_flies_in_full_physics() -> None:
    """Four UAVs meet in the middle of a circle."""
    start = 6.0 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    flight = crowds.fly(Crowd(start, -start), "orca", seed=1)
    assert flight.crashed == 0
    assert flight.arrived
    assert 1.0 < flight.min_distance_m < 3.0
    assert 4.0 < flight.seconds < 60.0  # 12 m at 3 m/s


def test_the_search_wins_a_game_of_each_kind() -> None:
    won = formation_games.play(1)
    assert won == dict.fromkeys(won, 1.0)
    assert len(won) == 4
