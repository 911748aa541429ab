"""The node that flies a team into a V, with UAVs that follow commands at once."""

import copy

import numpy as np
import pytest
from swarm_team import SwarmTeam

from volery.autonomy.swarm.v_formation import VFormation


class Team(SwarmTeam):
    """UAVs in a row, 3 m apart."""

    def __init__(self, count=7, **parameters):
        row = [[3.0 * k, 0.0, 5.0] for k in range(count)]
        super().__init__(VFormation, row, **{"step_s": 2.0, "slices": 200, **parameters})


def is_v(status):
    return status["phase"] == "cruise" and status["cost"] < 0.1


@pytest.fixture(scope="module")
def flown():
    team = Team()
    team.fly_until(is_v)
    return team


def test_a_team_from_a_row_flies_into_a_v(flown):
    assert flown.status["members"] == flown.names
    assert flown.status["upwash"] > 5.5
    assert flown.status["time_to_v_s"] is not None


def test_it_flies_on_in_the_v(flown):
    before = flown.positions.copy()
    searches = flown.status["searches"]
    flown.fly(20.0)
    assert is_v(flown.status)
    assert flown.status["searches"] == searches
    assert np.linalg.norm(flown.positions - before, axis=1).min() > 5.0


def test_a_team_that_loses_a_uav_forms_a_v_of_the_others():
    team = Team()
    team.fly_until(is_v)
    team.silent.add(3)
    team.fly_until(lambda status: "uav4" not in status["members"])
    assert team.status["reason"] == "uav4 left"
    team.fly_until(is_v)
    assert len(team.status["members"]) == 6
    assert team.status["upwash"] > 4.5


def test_a_larger_team_joins_the_v_of_the_first_seven():
    team = Team(count=15, slices=50)
    team.fly_until(is_v)
    assert team.status["upwash"] > 13.5
    team.silent.add(2)
    team.fly_until(lambda status: "uav3" not in status["members"])
    team.fly_until(is_v)
    assert len(team.status["members"]) == 14
    assert team.status["upwash"] > 12.5


def test_a_displaced_uav_returns_into_a_v():
    team = Team()
    team.fly_until(is_v)
    searches = team.status["searches"]
    team.positions[2] += (8.0, 5.0, 0.0)
    team.fly_until(lambda status: status["searches"] > searches)
    assert team.status["reason"] == "a UAV was displaced"
    team.fly_until(is_v)
    assert team.status["searches"] <= searches + 5  # from where it is now


def test_a_search_that_takes_too_long_says_so_and_the_team_flies_straight():
    team = Team(slices=2)
    team.fly_until(is_v)
    team.silent.add(3)
    team.fly_until(
        lambda status: status["phase"] == "search" and "used up its time" in status["reason"]
    )
    speeds = team.velocities.copy()
    team.fly(0.5)
    np.testing.assert_allclose(team.velocities[:, :2], speeds[:, :2], atol=0.02)
    team.fly_until(is_v)  # a later search may take longer


def test_uavs_keep_their_height_and_every_second_flies_above():
    team = Team(height_m=6.0, height_step_m=0.8)
    team.fly_until(is_v)
    heights = team.positions[:, 2]
    np.testing.assert_allclose(heights[::2], 6.0, atol=0.1)
    np.testing.assert_allclose(heights[1::2], 6.8, atol=0.1)


def test_the_same_seed_gives_the_same_flight():
    ends = []
    for _ in range(2):
        team = Team(count=3, seed=7)
        team.fly(40.0)
        ends.append(team.positions.tobytes())
    assert ends[0] == ends[1]


@pytest.mark.parametrize("seconds", [3.0, 8.0])
def test_a_snapshot_continues_the_same_flight(seconds):
    """While a search advances, and while a plan is followed."""
    team = Team(slices=2)
    team.fly(seconds)
    kept = copy.deepcopy(team.node.get_state())
    start, speeds, time_ns = team.positions.copy(), team.velocities.copy(), team.now_ns
    team.fly(30.0)
    again = Team(slices=2)
    again.run_to(time_ns)
    again.node.set_state(kept)
    again.positions, again.velocities = start, speeds
    again.fly(30.0)
    np.testing.assert_array_equal(again.positions, team.positions)


def test_it_waits_for_all_uavs():
    team = Team(count=3)
    team.silent.add(1)
    team.fly(10.0)
    assert team.node.phase == "ascend"
    assert not team.velocities.any()


def test_a_team_flees_from_a_hostile_uav_and_forms_a_v_again():
    row = [[3.0 * k, 0.0, 5.0] for k in range(4)]
    hunter = [500.0, 500.0, 5.0]
    team = SwarmTeam(VFormation, [*row, hunter], step_s=2.0, slices=200, hostile=["uav5"])
    team.fly_until(is_v)
    assert team.status["members"] == ["uav1", "uav2", "uav3", "uav4"]
    middle = team.positions[:4].mean(axis=0)
    team.positions[4] = middle + np.array([8.0, 0.0, 0.0])
    team.fly(2.0)
    assert team.status["phase"] == "flee"
    team.fly(6.0)
    gaps = np.linalg.norm(team.positions[:4] - team.positions[4], axis=1)
    assert gaps.min() > 15.0
    apart = np.linalg.norm(team.positions[:4, None] - team.positions[:4], axis=2)
    assert apart[np.triu_indices(4, 1)].min() > 1.5
    team.fly_until(is_v)
    assert team.status["searches"] > 1
