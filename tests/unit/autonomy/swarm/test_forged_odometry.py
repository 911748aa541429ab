"""Forged odometry of a team's UAVs: what a node refuses, and what it believes."""

import numpy as np
import pytest
from node_bench import odometry
from swarm_team import PERIOD_S, SwarmTeam

from volery.autonomy.swarm.flock import FlockNode

GRID = [[5.0 * x, 5.0 * y, 5.0] for x in range(3) for y in range(2)]
NAN = float("nan")


def flock():
    return SwarmTeam(FlockNode, GRID, waypoints_m=[[60.0, 2.5]])


def fly_forged(team, seconds, forged):
    """After each odometry of uav2, the node receives a forged one."""
    for _ in range(round(seconds / PERIOD_S)):
        team.fly(PERIOD_S)
        team.send("/uav2/odom", forged(team.now_ns, team.positions[1]))


def believed(team, row=1):
    return team.node._team.sample(row).position


REFUSED = {
    "not a number": lambda now_ns, at: odometry(now_ns, [NAN, at[1], at[2]]),
    "a velocity that is not a number": lambda now_ns, at: odometry(now_ns, at, [NAN, 0.0, 0.0]),
    "a velocity beyond reason": lambda now_ns, at: odometry(now_ns, at, [1e7, 0.0, 0.0]),
    "a position far away": lambda now_ns, at: odometry(now_ns, np.add(at, [40.0, 0.0, 0.0])),
    "a position somewhat away": lambda now_ns, at: odometry(now_ns, np.add(at, [0.0, 3.0, 0.0])),
    "a position on the ground": lambda now_ns, at: odometry(now_ns, [at[0], at[1], 0.0]),
    "a stamp of zero": lambda _, at: odometry(0, at),
    "an old position with its stamp": lambda now_ns, _: odometry(min(now_ns, 10**9), GRID[1]),
    "a stamp in the future": lambda now_ns, at: odometry(now_ns + 3 * 10**9, at),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_odometry_that_a_uav_can_hardly_have_sent_changes_nothing(kind):
    untouched, attacked = flock(), flock()
    for team in (untouched, attacked):
        team.fly(3.0)
    untouched.fly(4.0)
    fly_forged(attacked, 4.0, REFUSED[kind])
    np.testing.assert_array_equal(attacked.positions, untouched.positions)
    assert attacked.status["members"] == len(GRID)
    assert untouched.status["refused"] == 0
    assert attacked.status["refused"] > 70


def test_a_displaced_uav_is_believed_when_it_sends_no_other_positions():
    team = flock()
    team.fly(3.0)
    before = team.positions[1].copy()
    team.positions[1, 1] += 20.0
    team.fly(0.4)
    assert np.linalg.norm(believed(team) - before) < 1.0
    team.fly(0.2)
    np.testing.assert_allclose(believed(team), team.positions[1], atol=0.3)
    assert team.status["members"] == len(GRID)


def test_positions_within_the_limits_are_accepted_at_once():
    """A UAV at 20 m/s with noise of decimetres, and a forger that keeps within the same limits."""
    team = flock()
    team.fly(3.0)
    for k in range(20):
        team.positions[1] += [1.0, 0.3 * (-1.0) ** k, 0.0]
        sent = team.positions[1] + team.velocities[1] * PERIOD_S
        team.fly(PERIOD_S)
        np.testing.assert_allclose(believed(team), sent)
    fly_forged(team, PERIOD_S, lambda now_ns, at: odometry(now_ns, np.add(at, [0.9, 0.0, 0.0])))
    np.testing.assert_allclose(believed(team) - team.positions[1], [0.9, 0.0, 0.0], atol=1e-9)
    assert team.node._team.num_refused == 0


def test_a_forger_of_a_silent_uav_is_believed_after_a_while():
    team = flock()
    team.fly(3.0)
    team.silent.add(1)
    there = np.array([30.0, 30.0, 5.0])
    fly_forged(team, 0.4, lambda now_ns, _: odometry(now_ns, there))
    assert np.linalg.norm(believed(team) - there) > 5.0
    fly_forged(team, 0.2, lambda now_ns, _: odometry(now_ns, there))
    np.testing.assert_array_equal(believed(team), there)


def test_odometry_of_a_clock_that_was_set_back_is_believed():
    team = flock()
    team.fly(3.0)
    team.now_ns = 0
    team.send("/uav2/odom", odometry(0, [30.0, 30.0, 5.0]))
    np.testing.assert_array_equal(believed(team), [30.0, 30.0, 5.0])
