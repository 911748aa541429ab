"""The node that flies a team by a behaviour, with UAVs that follow commands at once."""

import copy
from typing import ClassVar

import numpy as np
import pytest
from node_bench import scan
from swarm_team import SwarmTeam

from volery.autonomy.swarm.flock import FlockNode
from volery.core.errors import PlanError, VoleryError

BEHAVIOURS = ("vasarhelyi", "olfati_saber", "orca", "trajectories")
GRID = [[5.0 * x, 5.0 * y, 5.0] for x in range(3) for y in range(3)]


class Away:
    """A behaviour of one's own: all fly along y."""

    radius_m = 1.0

    def velocities(self, flock, preferred, around):
        return np.tile([0.0, 1.0], (len(flock.position), 1))


class FlockAway(FlockNode):
    BEHAVIOURS: ClassVar = {"away": Away}


def distances(position):
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    return apart + np.diag(np.full(len(apart), np.inf))


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_a_team_flies_to_its_waypoints_in_turn(behaviour):
    team = SwarmTeam(FlockNode, GRID, behaviour=behaviour, waypoints_m=[[40.0, 5.0], [40.0, 45.0]])
    team.fly_until(lambda status: status["waypoint"] == 1)
    assert abs(team.positions[:, 0].mean() - 40.0) < 5.0
    team.fly_until(lambda status: status["arrived"] == 9)
    assert abs(team.positions[:, 1].mean() - 45.0) < 5.0
    assert distances(team.positions).min() > 2.0


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_a_team_swaps_across_its_middle_without_contact(behaviour):
    angle = np.arange(6) * np.pi / 3.0
    ring = np.stack([15.0 * np.cos(angle), 15.0 * np.sin(angle), np.full(6, 5.0)], axis=1)
    team = SwarmTeam(FlockNode, ring, behaviour=behaviour, swaps=True)
    nearest = np.inf
    for _ in range(600):
        team.fly(0.1)
        nearest = min(nearest, distances(team.positions).min())
    assert nearest > 1.0
    assert team.status["least_distance_m"] > 1.0


def test_a_team_keeps_its_height_and_stays_in_its_arena():
    arena = [-10.0, -10.0, 30.0, 20.0]
    team = SwarmTeam(FlockNode, GRID, height_m=6.0, arena_m=arena, waypoints_m=[[100.0, 5.0]])
    team.fly(60.0)
    np.testing.assert_allclose(team.positions[:, 2], 6.0, atol=0.1)
    assert team.positions[:, 0].max() < 30.0


def test_a_team_avoids_its_obstacles():
    team = SwarmTeam(
        FlockNode, [[0.0, 0.0, 5.0]], waypoints_m=[[40.0, 1.0]], obstacles_m=[[20.0, 0.2, 1.0]]
    )
    nearest = np.inf
    for _ in range(400):
        team.fly(0.1)
        nearest = min(nearest, np.hypot(*(team.positions[0, :2] - [20.0, 0.2])))
    assert nearest > 1.3
    assert team.positions[0, 0] > 38.0


def scan_of(post, radius, position):
    """Ranges (720,) of beams all around a UAV at `position` (2,) that sees a post."""
    angles = np.linspace(-np.pi, np.pi, 720)
    x, y = np.array(post) - position
    along, aside = x * np.cos(angles) + y * np.sin(angles), y * np.cos(angles) - x * np.sin(angles)
    inside = np.maximum(radius**2 - aside**2, 0.0)
    is_hit = (along > 0.0) & (np.abs(aside) < radius)
    return np.where(is_hit, along - np.sqrt(inside), np.inf)


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_a_team_avoids_what_its_lidars_see(behaviour):
    post, radius, starts = (20.0, 0.2), 0.5, [[0.0, 0.0, 5.0], [0.0, 6.0, 5.0]]
    goals = [[40.0, 1.0], [40.0, 7.0]]
    team = SwarmTeam(
        FlockNode, starts, behaviour=behaviour, goals_m=goals, scan="laser/horizontal/scan"
    )
    nearest = np.inf
    for _ in range(500):
        for row, name in enumerate(team.names):
            ranges = scan_of(post, radius, team.positions[row, :2])
            team.send(f"/{name}/laser/horizontal/scan", scan(team.now_ns, ranges))
        team.fly(0.1)
        nearest = min(nearest, np.hypot(*(team.positions[:, :2] - post).T).min())
    assert nearest > radius + 0.4
    np.testing.assert_allclose(team.positions[:, :2], goals, atol=1.5)


def test_echoes_of_teammates_and_of_the_ground_are_no_obstacles():
    team = SwarmTeam(FlockNode, [[0.0, 0.0, 5.0], [4.0, 0.0, 5.0]], scan="scan")
    team.fly(0.1)
    scans, members = team.node._scans, team.node._team.members
    team.send("/uav1/scan", scan(team.now_ns, np.full(360, 4.0)))
    team.fly(0.1)
    echoes = scans.echoes(members, team.positions[:, :2])
    assert np.isnan(echoes[1]).all()  # it has no scan
    seen = echoes[0][~np.isnan(echoes[0, :, 0])]
    np.testing.assert_allclose(np.hypot(*seen.T), 4.0, atol=0.3)
    assert 32 <= len(seen) <= 35  # of 36 sectors; the other UAV fills those ahead
    assert np.hypot(*(seen - [4.0, 0.0]).T).min() > 0.9


def test_the_team_flies_on_without_a_lost_uav():
    team = SwarmTeam(FlockNode, GRID, waypoints_m=[[40.0, 5.0]])
    team.fly(3.0)
    team.silent.add(4)
    team.fly_until(lambda status: status["members"] == 8)
    team.fly_until(lambda status: status["arrived"] == 8)


def test_a_behaviour_of_ones_own():
    team = SwarmTeam(FlockAway, GRID)
    before = team.positions.copy()
    team.fly(5.0)
    moved = team.positions - before
    assert (moved[:, 1] > 3.0).all()
    np.testing.assert_allclose(moved[:, 0], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"behaviour": "murmuration"}, "no swarm behaviour 'murmuration'"),
        ({"behaviour": "os:abort"}, "no swarm behaviour"),  # a parameter names no code
        ({"goals_m": [[0.0, 1.0]]}, "goals_m has one goal for each UAV"),
        ({"waypoints_m": []}, "waypoints_m is empty"),
        ({"waypoints_m": [[1.0, float("nan")]]}, "not finite"),
        ({"arena_m": [1.0, 2.0]}, "arena_m is"),
        ({"obstacles_m": [[1.0, 2.0]]}, "each entry has 3 numbers"),
    ],
)
def test_wrong_parameters_are_refused(parameters, words):
    with pytest.raises(VoleryError, match=words):
        SwarmTeam(FlockNode, GRID, **parameters)


def test_a_team_has_members_each_once():
    with pytest.raises(PlanError, match="at least one UAV, each once"):
        SwarmTeam(FlockNode, [])


def test_a_snapshot_continues_the_same_flight():
    team = SwarmTeam(FlockNode, GRID, waypoints_m=[[40.0, 5.0]])
    team.fly(5.0)
    kept = copy.deepcopy(team.node.get_state())
    start, speeds, time_ns = team.positions.copy(), team.velocities.copy(), team.now_ns
    team.fly(5.0)
    end = team.positions.copy()
    again = SwarmTeam(FlockNode, GRID, waypoints_m=[[40.0, 5.0]])
    again.run_to(time_ns)
    again.node.set_state(kept)
    again.positions, again.velocities = start, speeds
    again.fly(5.0)
    np.testing.assert_array_equal(again.positions, end)
