"""Hostile UAVs that pursue others, and flocks that flee from them or do not."""

import copy
import json

import numpy as np
import pytest
from swarm_team import SwarmTeam

from volery.autonomy.swarm.flock import FlockNode
from volery.autonomy.swarm.pursuit import Pursuit
from volery.core.errors import PlanError

GRID = [[5.0 * x, 5.0 * y, 5.0] for x in range(3) for y in range(3)]
TEAM = [f"uav{k + 1}" for k in range(len(GRID))]
HUNTER = "uav10"


def hunt(positions, pursuers=("uav1",), **parameters):
    """Pursuers among UAVs that hover."""
    return SwarmTeam(Pursuit, positions, pursuers=list(pursuers), **parameters)


def hunted_flock(**parameters):
    """Nine UAVs on a route of 200 m; the pursuer is 25 m behind and 1 m/s faster than they cruise.

    Returns the team and the statuses of the pursuit.
    """
    team = SwarmTeam(
        FlockNode, [*GRID, [-25.0, 4.0, 5.0]], waypoints_m=[[200.0, 5.0]], **parameters
    )
    pursuit = team.start(Pursuit, pursuers=[HUNTER], uavs=TEAM)
    return team, team.listen(f"{pursuit.full_name}/status")


def last(statuses):
    return json.loads(statuses[-1].data)


@pytest.mark.parametrize("behaviour", ["vasarhelyi", "olfati_saber", "orca", "trajectories"])
def test_a_flock_that_flees_is_not_captured_and_one_that_does_not_is(behaviour):
    careless, statuses = hunted_flock(behaviour=behaviour, uavs=TEAM)
    careless.fly(40.0)
    assert last(statuses)["captured"]
    wary, statuses = hunted_flock(behaviour=behaviour, hostile=[HUNTER])
    gaps = []
    for _ in range(400):
        wary.fly(0.1)
        apart = np.linalg.norm(wary.positions[:, None] - wary.positions, axis=2)
        gaps.append(apart[:9, :9][np.triu_indices(9, 1)].min())
    assert last(statuses)["captured"] == []
    assert last(statuses)["least_distance_m"] > 5.0
    assert min(gaps) > 1.5
    assert wary.status["members"] == 9  # the hostile UAV is none, though `uavs` names it
    assert wary.positions[:9, 0].mean() > 80.0  # it flees along its route


def test_a_flock_far_from_a_hostile_uav_flies_as_without_it():
    positions = []
    for hostile in ([], [HUNTER]):
        team = SwarmTeam(FlockNode, [*GRID, [-25.0, 4.0, 5.0]], uavs=TEAM, hostile=hostile)
        team.fly(5.0)
        positions.append(team.positions)
    np.testing.assert_array_equal(*positions)


def test_a_hostile_uav_on_the_ground_frightens_only_when_it_has_taken_off():
    team = SwarmTeam(
        FlockNode, [[0.0, 0.0, 5.0], [4.0, 0.0, 0.2]], hostile=["uav2"], waypoints_m=[[0.0, 0.0]]
    )
    team.fly(3.0)
    np.testing.assert_allclose(team.positions[0, :2], 0.0, atol=0.01)
    team.positions[1, 2] = 5.0
    team.fly(3.0)
    assert team.positions[0, 0] < -4.0


def test_a_pursuer_captures_one_after_the_other_and_then_hovers():
    team = hunt([[0.0, 0.0, 5.0], [20.0, 0.0, 8.0], [12.0, 0.0, 6.0]], speed_m_s=4.0)
    team.fly(1.0)
    assert team.status["targets"] == {"uav1": "uav3"}
    assert team.velocities[0, 0] == pytest.approx(4.0, abs=1e-6)
    team.fly(3.0)
    assert team.status["captured"] == ["uav3"]
    assert team.status["least_distance_m"] <= 1.0
    team.fly(10.0)
    assert team.status == {
        "targets": {},
        "least_distance_m": team.status["least_distance_m"],
        "captured": ["uav3", "uav2"],
    }
    np.testing.assert_allclose(team.velocities, 0.0, atol=1e-3)
    assert team.positions[0, 2] == pytest.approx(5.0, abs=0.01)


def test_landed_and_silent_uavs_are_not_pursued():
    team = hunt([[0.0, 0.0, 5.0], [10.0, 0.0, 0.1], [0.0, 15.0, 5.0], [0.0, 40.0, 5.0]])
    team.fly(1.0)
    assert team.status["targets"] == {"uav1": "uav3"}
    team.silent.add(2)
    team.fly(1.5)
    assert team.status["targets"] == {"uav1": "uav4"}
    team.positions[1, 2] = 5.0  # it takes off again
    team.fly(1.0)
    assert team.status["targets"] == {"uav1": "uav2"}


def test_pursuers_of_the_same_uav_do_not_touch_each_other():
    team = hunt(
        [[0.0, 0.0, 5.0], [0.0, 3.0, 5.0], [30.0, 1.5, 5.0]],
        pursuers=["uav1", "uav2"],
        capture_m=0.5,
    )
    nearest = np.inf
    for _ in range(75):
        team.fly(0.2)
        nearest = min(nearest, np.linalg.norm(team.positions[0] - team.positions[1]))
        if team.status["captured"]:
            break
    assert team.status["captured"] == ["uav3"]
    assert nearest > 1.5


def test_pursuers_that_have_not_taken_off_are_waited_for():
    team = hunt([[0.0, 0.0, 0.1], [10.0, 0.0, 5.0]])
    team.fly(2.0)
    assert not team.velocities.any()
    assert team.statuses == []
    team.positions[0, 2] = 5.0
    team.fly(1.0)
    assert team.velocities[0, 0] > 3.0


def test_a_pursuit_follows_uavs_and_commands_its_pursuers_alone():
    team = hunt([[0.0, 0.0, 5.0], [10.0, 0.0, 5.0]])
    team.fly(0.5)
    topics = {topic.name: topic for topic in team.graph.topics()}
    assert topics["/uav1/cmd_vel"].publishers
    assert not topics["/uav2/cmd_vel"].publishers
    with pytest.raises(PlanError, match="at least one UAV, each once"):
        hunt([[0.0, 0.0, 5.0]], pursuers=[])


def test_a_snapshot_continues_the_same_pursuit():
    start = [[0.0, 0.0, 5.0], [9.0, 0.0, 5.0], [5.0, 6.0, 5.0]]
    team = hunt(start)
    team.fly(2.0)
    assert team.status["captured"]
    kept = copy.deepcopy(team.node.get_state())
    positions, speeds, time_ns = team.positions.copy(), team.velocities.copy(), team.now_ns
    team.fly(3.0)
    again = hunt(start)
    again.run_to(time_ns)
    again.node.set_state(kept)
    again.positions, again.velocities = positions, speeds
    again.fly(3.0)
    np.testing.assert_array_equal(again.positions, team.positions)
    assert again.status == team.status
