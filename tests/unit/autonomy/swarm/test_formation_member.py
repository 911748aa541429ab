"""Teams that form a V without a leader: the planner of a bird, and the nodes over a radio."""

import json

import numpy as np
import pytest
from node_bench import NodeBench
from swarm_team import ObedientUavs

from volery.autonomy.swarm.formation_fitness import fitness_cost, formation_fitness
from volery.autonomy.swarm.formation_member import FormationMember, MemberPhase
from volery.autonomy.swarm.member_planning import MemberPlanner
from volery.autonomy.swarm.particle_swarm import FlockLimits
from volery.autonomy.swarm.random_start import random_start
from volery.core.errors import PlanError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type

LIMITS = FlockLimits(1.0, 2.67, 1.33)
REPORT = message_type("volery_interfaces/msg/TeamReport")


def fly(count, seed, steps=150):
    """Returns the costs of a flock whose birds plan in turn, and their least distance."""
    start = random_start(count, seed)
    flock = np.concatenate((start.positions.T, start.velocities.T))
    birds = [MemberPlanner(LIMITS, seed=100 * seed + k) for k in range(count)]
    for row, bird in enumerate(birds):
        bird.begin(flock, row)
    costs, nearest = [], np.inf
    for _ in range(steps):
        joining = np.array([bird.is_joining for bird in birds])
        before = flock[:2].copy()
        for row, bird in enumerate(birds):
            flock[2:, row] = bird.velocity(flock, joining, row)
            joining[row] = bird.is_joining
        for part in np.linspace(0.0, 1.0, 6):
            at = before + part * flock[2:]
            apart = np.linalg.norm(at[:, :, None] - at[:, None], axis=0)
            nearest = min(nearest, apart[~np.eye(count, dtype=bool)].min())
        flock[:2] = before + flock[2:]
        costs.append(fitness_cost(flock))
        if costs[-1] < 1e-6:
            break
    return costs, nearest


@pytest.mark.parametrize("seed", range(1, 5))
def test_seven_birds_that_plan_for_themselves_fly_into_a_v(seed):
    costs, nearest = fly(7, seed)
    assert costs[-1] < 1e-6
    assert nearest > 0.9


def test_the_birds_of_a_larger_flock_join_the_v_of_the_foremost():
    costs, nearest = fly(15, 1)
    assert costs[-1] < 1e-6
    assert nearest > 0.9


def test_the_same_seed_gives_the_same_flight():
    assert fly(7, 3, 20) == fly(7, 3, 20)


def test_a_bird_that_hears_none_flies_on_and_waits_for_no_formation():
    bird = MemberPlanner(LIMITS)
    bird.is_joining = True
    velocity = bird.velocity(np.array([[0.0], [0.0], [0.5], [0.2]]), np.array([True]), 0)
    assert not bird.is_joining
    np.testing.assert_allclose(velocity, [0.5, 0.2])


def test_a_velocity_keeps_the_distance_where_that_is_possible():
    flock = np.array([[0.0, 1.6], [0.0, 0.0], [1.0, -0.2], [0.0, 0.0]])
    bird = MemberPlanner(LIMITS)
    velocity = bird.velocity(flock, np.zeros(2, bool), 0)
    apart = flock[:2, 1] + flock[2:, 1] - velocity
    assert np.linalg.norm(apart) >= 1.0 - 1e-6


def test_a_bird_at_rest_flies_off_and_one_without_a_heading_of_its_flock_goes_on():
    flock = np.array([[0.0, 3.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    bird = MemberPlanner(LIMITS)
    bird.is_joining = True
    velocity = bird.velocity(flock, np.array([True, False]), 0)
    assert 0.05 <= np.linalg.norm(velocity) <= 0.2


class Team(ObedientUavs):
    """UAVs in a row, 10 m apart, each with a node of its own; the bench is their radio."""

    def __init__(self, count=7, start_m=(0.0, 0.0), **parameters):
        super().__init__([[10.0 * (k - (count - 1) / 2), 0.0, 5.0] for k in range(count)])
        self.deaf = set()
        self.lost_reports = 0.0
        self._rng = np.random.default_rng(1)
        self.nodes, self.statuses = [], []
        for row, name in enumerate(self.names):
            node = FormationMember(
                context=self.context,
                namespace=f"/{name}",
                parameter_overrides={"uavs": self.names, "start_m": list(start_m)} | parameters,
            )
            self.nodes.append(node)
            self.statuses.append(self.listen(f"/{name}/formation_member/status"))
            self.graph.subscribe(f"/{name}/team", lambda p, row=row: self._relay(row, p.message))
        self._ears = [self.graph.advertise(f"/{name}/radio/team", REPORT) for name in self.names]

    def _relay(self, sender, report):
        for row, ear in enumerate(self._ears):
            if row != sender and row not in self.deaf and self._rng.random() >= self.lost_reports:
                ear.publish(report)

    def cost(self, rows=None):
        """Returns the cost of the formation that the UAVs fly in."""
        rows = list(range(len(self.names))) if rows is None else rows
        position, velocity = self.positions[rows, :2], self.velocities[rows, :2]
        return formation_fitness(position / 3.0, velocity * 2.0 / 3.0).cost

    def fly_until(self, condition, seconds=300.0):
        for _ in range(round(seconds / 2.0)):
            self.fly(2.0)
            if condition():
                return
        raise AssertionError([self.status(row) for row in range(len(self.names))])

    def status(self, row):
        return json.loads(self.statuses[row][-1].data) if self.statuses[row] else None


@pytest.fixture(scope="module")
def flown():
    team = Team()
    team.fly_until(lambda: team.cost() < 0.01)
    return team


def test_a_team_flies_into_a_v_by_reports_alone(flown):
    for row in range(7):
        status = flown.status(row)
        assert status["members"] == flown.names
        assert status["phase"] in ("search", "join")
    flown.fly(20.0)
    assert flown.cost() < 0.01
    assert flown.status(0)["time_to_v_s"] is not None


def test_a_team_that_loses_a_uav_forms_a_v_of_the_others():
    team = Team()
    team.fly_until(lambda: team.cost() < 0.01)
    team.silent.add(3)
    team.fly(3.0)
    assert team.nodes[3].phase is MemberPhase.LOST
    team.positions[3] = 500.0, 500.0, 0.0
    rest = [0, 1, 2, 4, 5, 6]
    team.fly_until(lambda: team.cost(rest) < 0.01)
    assert all("uav4" not in team.status(row)["members"] for row in rest)


def test_it_forms_a_v_although_a_third_of_the_reports_is_lost():
    team = Team(count=5)
    team.lost_reports = 0.33
    team.fly_until(lambda: team.cost() < 0.01)


def test_a_uav_that_hears_none_sets_off_never_and_one_without_start_gathers_not():
    team = Team(count=2, start_m=())
    team.deaf = {0, 1}
    team.fly(10.0)
    assert [node.phase for node in team.nodes] == [MemberPhase.READY] * 2
    np.testing.assert_allclose(team.positions[:, 0], [-5.0, 5.0], atol=0.1)


@pytest.mark.parametrize("seed", range(2, 10))
def test_uavs_that_have_arrived_make_way_for_the_others(seed):
    team = Team(seed=seed)
    team.fly_until(
        lambda: all(node.phase in (MemberPhase.SEARCH, MemberPhase.JOIN) for node in team.nodes),
        seconds=100.0,
    )


def test_a_uav_whose_way_to_its_start_is_blocked_waits_where_it_is():
    team = Team(count=2)
    held, phases = team.positions[0].copy(), []
    for _ in range(30):
        team.fly(1.0)
        team.positions[0] = held
        phases.append(team.nodes[0].phase)
    assert phases[8] is MemberPhase.GATHER
    assert phases[-1] in (MemberPhase.SEARCH, MemberPhase.JOIN)


def test_a_team_waits_a_minute_for_one_that_it_does_not_hear():
    team = Team(count=3)
    team.silent = {2}
    team.fly(60.0)
    assert [node.phase for node in team.nodes] == [MemberPhase.READY] * 2 + [MemberPhase.WAIT]
    team.fly(25.0)
    assert all(node.phase in (MemberPhase.SEARCH, MemberPhase.JOIN) for node in team.nodes[:2])


def test_a_displaced_uav_flies_on_from_where_it_is():
    team = Team(count=2)
    team.fly_until(lambda: team.nodes[0].phase is MemberPhase.SEARCH)
    team.positions[0] += [0.0, 12.0, 0.0]
    displaced = team.positions[0].copy()
    team.fly(1.2)
    assert np.linalg.norm(team.positions[0] - displaced) < 3.0
    assert np.linalg.norm(team.nodes[0]._bird_at(team.now_ns) - team.positions[0, :2]) < 4.5


def test_reports_that_make_no_sense_are_refused():
    team = Team(count=2)
    bad = {
        "other": {"name": "uav9"},
        "own": {"name": "uav1"},
        "phase": {"phase": "dance"},
        "nan": {"x": np.nan},
        "late": {"stamp_s": 500},
    }
    for case in bad.values():
        report = zero_message("volery_interfaces/msg/TeamReport")
        report.name, report.phase = case.get("name", "uav2"), case.get("phase", "search")
        report.position.x = case.get("x", 0.0)
        report.header.stamp.sec = case.get("stamp_s", 0)
        team.send("/uav1/radio/team", report)
    assert team.nodes[0]._mates == {}


@pytest.mark.parametrize(
    "parameters",
    [
        {"uavs": ["uav2"]},
        {"uavs": ["uav1", "uav1"]},
        {"start_m": [1.0]},
    ],
)
def test_impossible_parameters_are_refused(parameters):
    with pytest.raises(PlanError, match="parameter"):
        NodeBench().start(FormationMember, **{"uavs": ["uav1", "uav2"]} | parameters)
