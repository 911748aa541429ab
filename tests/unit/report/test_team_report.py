"""The report's section on a formation or a flock, from a flight and from logs made up here."""

from __future__ import annotations

import itertools
import json
import math
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message
from volery.report.logged_flights import read_flight
from volery.report.logged_teams import FLOCK, FORMATION, EnergyMeter, LoggedTeam, TeamLog
from volery.report.trajectories import RecordedTrajectory
from volery.report.trajectory_page import write_log_report
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

S = 1_000_000_000
SENSORS = [
    {"kind": "imu"},
    {"kind": "odometry", "noise": False},
    {"kind": "ground_truth"},
    {"kind": "battery"},
]


@pytest.fixture(name="log", scope="module")
def _log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three UAVs on their flight into a V, until two seconds after the first one."""
    path = tmp_path_factory.mktemp("logs") / "v.mcap"
    changes = {"types.bird.sensors": SENSORS, "uavs[0].last_position_m": [112.0, 100.0]}
    scenario = load_scenario("v_formation").with_(changes, uavs=3, duration_s=200.0)
    with closing(create_log(path)) as log, Simulation(scenario) as simulation:
        simulation.graph.subscribe_all(log.write, recorded_topics(simulation.graph))
        statuses: list[Any] = []
        simulation.graph.subscribe(
            FORMATION, lambda published: statuses.append(json.loads(published.message.data))
        )
        simulation.run_until(lambda: bool(statuses) and statuses[-1]["phase"] == "cruise", 150.0)
        simulation.run(2.5)
    return path


def write(log: Any, topic: str, time_ns: int, message: Any) -> None:
    log.write(m.Published(topic, m.type_name(type(message)), time_ns, message))


def odometry(time_ns: int, x: float, y: float) -> Any:
    message = zero_message("nav_msgs/msg/Odometry")
    message.header = m.header(time_ns, "map")
    message.pose.pose = m.Pose(m.Point(x, y, 5.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    return message


def test_a_recorded_flight_holds_the_team(log: Path) -> None:
    flight = read_flight(log)
    team = flight.team
    assert team is not None
    assert team.topic == FORMATION
    assert (team.phases[0], team.phases[-1]) == ("search", "cruise")
    assert team.members[0] == {"uav1", "uav2", "uav3"}
    assert team.search_times_s.tolist() == [team.time_s[0]]
    assert team.time_s[team.phases.index("cruise")] == team.time_to_v_s
    assert team.numbers["cost"][0] > 0.1 > team.numbers["cost"][-1]
    assert (team.separation_m, team.lost_cost) == (3.0, 0.1)


def test_the_page_draws_the_team(log: Path, tmp_path: Path) -> None:
    flight = read_flight(log)
    page = write_log_report(log, tmp_path / "one").path.read_text(encoding="utf-8")
    team = flight.team
    assert team is not None
    of_team = page[page.index("<h2>The team</h2>") : page.index("<h2>uav1</h2>")]
    assert of_team.count("<svg") == 5
    assert f"The first V after {team.time_to_v_s:.1f} s." in of_team
    assert f">{team.time_s[0]:.1f} s, search<" in of_team
    assert "a search begins" in of_team
    paths = [each.truth.position for each in flight.uavs if each.truth is not None]
    pairs = itertools.combinations(paths, 2)
    min_distance = min(np.linalg.norm(one - other, axis=1).min() for one, other in pairs)
    assert f"included: {min_distance:.2f} m at" in of_team
    used = sum(each.energy_j for each in flight.uavs) / 3600.0
    assert 1.0 < used < 20.0  # three F450s for half a minute
    assert f"{used:.1f} Wh in all" in of_team
    again = write_log_report(log, tmp_path / "two").path.read_text(encoding="utf-8")
    assert again == page


def test_the_page_of_one_uav_has_no_team(log: Path, tmp_path: Path) -> None:
    page = write_log_report(log, tmp_path, uav="uav2").path.read_text(encoding="utf-8")
    assert "<h2>uav2</h2>" in page
    assert "The team" not in page


def flock_log(path: Path, statuses: list[tuple[float, str]], behaviour: str = "orca") -> Path:
    """Two UAVs that fly north side by side, 5 m apart at first and 3 m at the end of a minute.

    A third one is far away, and its log ends earlier.
    """
    nodes = [{"node": "flock", "parameters": {"behaviour": behaviour}}]
    scenario = {"name": "two", "seed": 1, "version": "0", "content": {"nodes": nodes}}
    with closing(create_log(path)) as log:
        write(log, "/volery/scenario", 0, m.String(json.dumps(scenario)))
        for k in range(601):
            time_ns = k * S // 10
            for name, x in (("uav1", 0.0), ("uav2", 5.0 - k / 300.0)):
                write(log, f"/{name}/odom", time_ns, odometry(time_ns, x, 0.1 * k))
            if k < 100:
                write(log, "/uav3/odom", time_ns, odometry(time_ns, 50.0, 0.0))
        for time_s, status in statuses:
            write(log, FLOCK, round(time_s * S), m.String(status))
    return path


def flock_status(order: float) -> str:
    return json.dumps({"members": 2, "waypoint": 0, "arrived": 1, "order": order})


def test_a_flock_has_its_order_and_the_distance_of_its_rule(tmp_path: Path) -> None:
    statuses = [(float(k), flock_status(1.0 - 0.01 * k)) for k in range(5, 40)]
    path = flock_log(tmp_path / "flock.mcap", statuses)
    team = read_flight(path).team
    assert team is not None
    assert team.separation_m == 2.0
    np.testing.assert_allclose(team.numbers["order"], 1.0 - 0.01 * team.time_s)
    page = write_log_report(path, tmp_path).path.read_text(encoding="utf-8")
    of_team = page[page.index("<h2>The team</h2>") : page.index("<h2>uav1</h2>")]
    assert of_team.count("<svg") == 3
    assert "included: 3.00 m at 60.0 s. ORCA keeps the dashed distance." in of_team
    assert ">planned: 2 m<" in of_team


def test_a_rule_that_keeps_no_distance_has_no_line(tmp_path: Path) -> None:
    path = flock_log(tmp_path / "flock.mcap", [(1.0, flock_status(1.0))], "vasarhelyi")
    page = write_log_report(path, tmp_path).path.read_text(encoding="utf-8")
    assert "included: 3.00 m at 60.0 s.<" in page
    assert "planned" not in page


def test_statuses_of_others_may_hold_anything(tmp_path: Path) -> None:
    """Text of a log reaches neither mathtext nor numbers beyond the charts' limits."""
    odd = [
        "",
        "[1]",
        "[" * 100_000,
        '{"order": NaN}',
        json.dumps({"order": 10**400, "members": ["$\\frac{"], "phase": "$\\frac{"}),
        json.dumps({"order": True, "arrived": "many", "members": 0, "phase": []}),
    ]
    path = flock_log(tmp_path / "flock.mcap", [(float(k), text) for k, text in enumerate(odd)])
    team = read_flight(path).team
    assert team is not None
    assert np.isnan(team.numbers["order"][[0, 2]]).all()
    assert team.numbers["order"][1] == 1e6
    assert set(team.phases) == {""}
    assert "The team" in write_log_report(path, tmp_path).path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("nodes", "bounds"),
    [
        ([{"node": "v_formation"}], (3.0, 0.1)),
        (
            [
                {"node": "flock"},
                {
                    "node": "v_formation",
                    "parameters": {"wing_span_m": 2.0, "min_distance": 1.2, "lost_cost": 0.5},
                },
            ],
            (2.4, 0.5),
        ),
        ([{"node": "v_formation", "parameters": {"wing_span_m": "2"}}], (math.nan, 0.1)),
        ([{"node": "v_formation", "parameters": 3}], (math.nan, math.nan)),
        (["v_formation"], (math.nan, math.nan)),
        (3, (math.nan, math.nan)),
    ],
)
def test_bounds_are_those_of_the_recorded_scenario(nodes: Any, bounds: tuple[float, float]) -> None:
    collected = TeamLog()
    collected.add(FORMATION, 0, m.String('{"phase": "cruise"}'))
    collected.add(FLOCK, S, m.String(flock_status(1.0)))
    team = collected.team({"nodes": nodes})
    assert team is not None
    assert len(team.time_s) == 1  # one team is drawn
    np.testing.assert_allclose((team.separation_m, team.lost_cost), bounds)


def test_positions_are_unknown_outside_of_the_poses_and_in_gaps() -> None:
    rows = [(t, t, 2.0 * t, 5.0, 0.0, 0.0, 0.0, 1.0) for t in (1.0, 1.2, 1.4, 3.0, 3.2)]
    path = RecordedTrajectory.of_rows(rows)
    found = path.positions_at(np.array([0.9, 1.0, 1.3, 2.0, 3.1, 3.2, 3.3]))
    nan = math.nan
    np.testing.assert_allclose(found[:, 1], [nan, 2.0, 2.6, nan, 6.2, 6.4, nan])
    assert np.isnan(RecordedTrajectory.of_rows(rows[:1]).positions_at(np.array([1.0]))).all()


def test_one_stamp_far_away_takes_no_memory(tmp_path: Path) -> None:
    """Two UAVs, one of which has a pose of the year 2023."""
    path = flock_log(tmp_path / "flock.mcap", [(1.0, flock_status(1.0))])
    late = tmp_path / "late.mcap"
    with closing(create_log(late)) as log:
        for name, stamps in (("uav1", (0, S // 10)), ("uav2", (0, S // 10, 1_700_000_000 * S))):
            for stamp in stamps:
                write(log, f"/{name}/odom", 0, odometry(stamp, 0.0, 0.0))
        write(log, FLOCK, 0, m.String(flock_status(1.0)))
    for each in (path, late):
        assert write_log_report(each, tmp_path / each.stem).path.exists()


def team_of(phases: list[str]) -> LoggedTeam:
    count = len(phases)
    return LoggedTeam(FORMATION, np.arange(float(count)), {}, phases, [frozenset()] * count)


def test_moments_are_those_of_new_phases() -> None:
    phases = [*["search"] * 3, *["reform"] * 9, *["cruise"] * 30]
    assert {0, 3, 12, 41} <= set(team_of(phases).moments(6))
    assert len(team_of(phases).moments(6)) == 6
    many = team_of(["search", "reform", "cruise"] * 20).moments(6)
    assert len(many) == 6
    assert (many[0], many[-1]) == (0, 59)
    assert team_of([""]).moments(6) == [0]
    assert team_of([""] * 3).moments(6) == [0, 1, 2]


def test_energy_is_the_integral_of_power() -> None:
    meter, message = EnergyMeter(), zero_message("sensor_msgs/msg/BatteryState")
    message.voltage = 10.0
    for second, current in ((0, -2.0), (1, -4.0), (2, math.nan), (3, -4.0), (60, -4.0), (61, -4.0)):
        assert math.isnan(meter.energy_j) == (second < 2)
        message.current = current
        meter.add(second * S, message)
    assert meter.energy_j == pytest.approx(30.0 + 80.0 + 40.0)  # nothing is known of a minute


def test_a_formation_without_a_leader_is_that_of_the_first_uav_with_a_status() -> None:
    scenario = {
        "types": {
            "bird": {"nodes": [{"node": "formation_member", "parameters": {"min_distance": 0.9}}]}
        }
    }
    log = TeamLog()
    for second, phase in enumerate(("ready", "search", "join", "dance")):
        for uav in ("uav2", "uav1"):
            status = {"phase": phase, "members": ["uav1", "uav2"], "cost": 1.0 - 0.3 * second}
            log.add(f"/{uav}/formation_member/status", second * S, m.String(json.dumps(status)))
    team = log.team(scenario)
    assert team is not None
    assert team.topic == FORMATION
    assert team.phases == ["ready", "search", "join", ""]
    np.testing.assert_allclose(team.numbers["cost"], [1.0, 0.7, 0.4, 0.1])
    assert (team.separation_m, team.lost_cost) == (pytest.approx(2.7), 0.1)
    assert len(team.search_times_s) == 0
