"""A team's search: shared out, taken over, agreed upon by a radio that loses and repeats."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from team_bench import AREA, TeamBench

from volery.autonomy.perception.map_frame import UNKNOWN_POSE
from volery.autonomy.planning.local_planner import TOO_DISTURBED
from volery.autonomy.search.search_positions import Area
from volery.autonomy.team.assignment import SectorClaim, Worker, assign, must_yield
from volery.autonomy.team.mission_messages import goal_at
from volery.autonomy.team.sectors import Coverage, Sectors, from_bits, to_bits
from volery.autonomy.team.target_list import Detection, TargetList
from volery.autonomy.team.task_manager import BLOWN
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import String, TFMessage, header, message_type

HOMES = {"uav1": (0.0, 0.0), "uav2": (0.0, 25.0), "uav3": (0.0, 50.0)}
NONE = np.zeros(12, np.bool_)


def worker(x: float, y: float, sector: int = -1, since: int = 0, given_up: Any = NONE) -> Worker:
    return Worker(np.array([x, y]), sector, since, given_up)


# ----------------------------------------------------------------------------------------- parts


def test_sectors_tile_the_area() -> None:
    sectors = Sectors(Area(*AREA), 20.0)
    assert sectors.shape == (3, 4)
    size = sum((a.x_max - a.x_min) * (a.y_max - a.y_min) for a in map(sectors.of, range(12)))
    assert size == pytest.approx(80.0 * 60.0)
    assert sectors.of(5) == Area(20.0, 20.0, 40.0, 40.0)
    assert sectors.centres()[11].tolist() == [70.0, 50.0]
    assert len(Sectors(Area(0.0, 0.0, 5.0, 3.0), 40.0)) == 1


def test_coverage_is_what_was_in_sight() -> None:
    coverage = Coverage(Area(0.0, 0.0, 20.0, 20.0), 0.5)
    new = coverage.look(np.array([10.0, 10.0]), 6.0)
    assert coverage.covered_fraction == pytest.approx(np.pi * 36.0 / 400.0, rel=0.02)
    assert new == coverage.seen.sum()
    assert coverage.look(np.array([10.0, 10.0]), 6.0) == 0
    assert coverage.look(np.array([80.0, 10.0]), 6.0) == 0


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_flags_come_back_from_a_report(flags: list[bool]) -> None:
    given_flags = np.array(flags)
    assert from_bits(to_bits(given_flags), len(flags)).tolist() == flags
    assert from_bits(to_bits(given_flags)[:-1], len(flags)).shape == (len(flags),)


@given(
    st.integers(1, 6),
    st.sets(st.integers(0, 11)),
    st.lists(st.tuples(st.floats(0, 80), st.floats(0, 60)), min_size=6, max_size=6),
)
def test_each_gets_one_sector_of_its_own(count: int, done: set[int], positions: Any) -> None:
    searched = np.isin(np.arange(12), list(done))
    workers = {f"uav{k + 1}": worker(*positions[k]) for k in range(count)}
    centres = Sectors(Area(*AREA), 20.0).centres()
    chosen = assign(workers, searched, centres)
    assert len(set(chosen.values())) == len(chosen) == min(count, 12 - len(done))
    assert not searched[list(chosen.values())].any()
    shuffled = dict(reversed(workers.items()))
    assert assign(shuffled, searched, centres) == chosen


def test_sectors_of_others_and_those_given_up_are_left() -> None:
    centres = Sectors(Area(*AREA), 20.0).centres()
    cannot = np.ones(12, np.bool_)
    cannot[7] = False
    workers = {"uav1": worker(0, 0, given_up=cannot), "uav2": worker(0, 0, 7)}
    assert assign(workers, NONE, centres) == {}
    workers["uav2"] = worker(0, 0, 8)
    assert assign(workers, NONE, centres) == {"uav1": 7}


def test_the_earlier_claim_counts_and_then_the_name() -> None:
    others = {"uav1": worker(0, 0, 4, 100), "uav3": worker(0, 0, 4, 90)}
    assert must_yield(SectorClaim(95, "uav2"), 4, others)
    assert not must_yield(SectorClaim(90, "uav2"), 4, others)
    assert must_yield(SectorClaim(100, "uav2"), 4, {"uav1": worker(0, 0, 4, 100)})
    assert not must_yield(SectorClaim(100, "uav2"), 5, others)


def find(finder: str, number: int, x: float, stamp: int = 1, variance: float = 1.0) -> Detection:
    return Detection(finder, number, stamp, (x, 0.0, 0.5), (variance, 0.0, 0.0, variance), 5)


def test_finds_of_one_thing_are_one_target() -> None:
    found = TargetList(4.0)
    assert found.take([find("uav1", 1, 10.0), find("uav2", 1, 12.0, 2), find("uav2", 2, 40.0)])
    assert not found.take([find("uav1", 1, 99.0, 0)])  # an old one
    first, second = found.targets()
    assert first.position[0] == pytest.approx(11.0)
    assert first.covariance[0] == pytest.approx(0.505)
    assert (first.finder, first.sightings, first.stamp_ns) == ("uav1", 10, 2)
    assert second.position[0] == 40.0
    changed = [Detection.from_message(message) for message in found.changed(0)]
    assert sorted(changed) == sorted(found.detections.values())


def test_many_finds_are_published_in_turns_and_broken_ones_not_at_all() -> None:
    found = TargetList(4.0)
    found.take(find("uav1", k, 10.0 * k, stamp=100 - k) for k in range(7))
    turns = [[message.number for message in found.changed(turn)] for turn in range(4)]
    assert turns == [[0, 1, 2, 3], [0, 1, 4, 5], [0, 1, 6, 2], [0, 1, 3, 4]]
    broken = find("uav2", 1, math.nan), find("uav2", 2, 5.0, variance=-1.0)
    assert not found.take(broken)
    assert len(found.detections) == 7


# ------------------------------------------------------------------------------------- the team


def test_three_search_everything_and_come_home() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    sectors = [manager.member.sector for manager in bench.managers.values()]
    assert len(set(sectors)) == 3
    bench.run(140.0)
    assert set(bench.phases().values()) == {"done"}
    for name, manager in bench.managers.items():
        assert manager.member.searched.all()
        np.testing.assert_allclose(bench.uavs[name].position[:2], HOMES[name], atol=2.0)


def test_three_are_faster_than_one() -> None:
    times = []
    for homes in (HOMES, {"uav1": HOMES["uav1"]}):
        bench = TeamBench(homes)
        while not bench.managers["uav1"].member.searched.all():
            bench.run(1.0)
        times.append(bench.clock.now_ns)
    assert times[1] > 2.3 * times[0]


@pytest.mark.parametrize(("lost", "doubled"), [(0.5, 0.0), (0.2, 0.5), (0.9, 0.2)])
def test_a_bad_radio_costs_time_and_leaves_nothing_out(lost: float, doubled: float) -> None:
    bench = TeamBench(HOMES, lost, doubled)
    bench.run(250.0)
    assert set(bench.phases().values()) == {"done"}
    assert all(manager.member.searched.all() for manager in bench.managers.values())


def test_the_rest_of_a_lost_uav_is_taken_over() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    left = bench.managers["uav2"].member.sector
    assert left >= 0
    bench.uavs["uav2"].stuck = True
    bench.is_connected = lambda one, other: "uav2" not in (one, other)
    bench.run(140.0)
    for name in ("uav1", "uav3"):
        assert bench.managers[name].member.searched[left]
        assert bench.managers[name].phase == "done"
        assert "silent: uav2" in bench.managers[name].problem


def test_one_that_gets_nowhere_leaves_its_sector_to_others() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    left = bench.managers["uav2"].member.sector
    bench.uavs["uav2"].stuck = True
    bench.run(250.0)
    assert bench.managers["uav1"].member.searched.all()
    assert bench.managers["uav2"].member.searched[left]


def test_low_battery_brings_one_home_and_the_others_do_its_part() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    bench.uavs["uav3"].charge = 0.2
    bench.run(1.0)
    assert bench.managers["uav3"].phase == "return"
    assert "low battery" in bench.managers["uav3"].problem
    bench.run(170.0)
    assert set(bench.phases().values()) == {"done"}
    assert bench.managers["uav1"].member.searched.all()


def test_one_that_is_held_waits_and_others_take_its_sector() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    uav, manager = bench.uavs["uav2"], bench.managers["uav2"]
    left, position = manager.member.sector, uav.position.copy()
    assert bench.order("uav2", "hold") == "holds until resume, return or land"
    bench.run(30.0)
    assert uav.asked[-1] == "hold"
    assert (str(manager.phase), manager.member.sector) == ("hold", -1)
    assert manager.problem == "held by the operator"
    np.testing.assert_allclose(uav.position, position, atol=1.0)
    assert {bench.managers[n].member.sector for n in ("uav1", "uav3")} & {
        left
    } or manager.member.searched[left]
    bench.order("uav2", "resume")
    bench.run(2.0)
    assert (str(manager.phase), manager.problem, uav.paused) == ("search", "", False)
    bench.run(140.0)
    assert set(bench.phases().values()) == {"done"}
    assert manager.member.searched.all()


def test_one_that_is_held_in_its_climb_climbs_on_before_it_searches() -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    uav, manager = bench.uavs["uav1"], bench.managers["uav1"]
    uav.climb_limit_m = 0.5  # too low for planners
    while not uav.flies:
        bench.run(0.1)
    assert manager.phase == "rise"
    bench.order("uav1", "hold")
    bench.run(5.0)
    assert (str(manager.phase), uav.position[2]) == ("hold", 0.5)
    assert bench.order("uav1", "resume") == "searches"
    bench.run(1.0)
    assert (str(manager.phase), manager.member.sector) == ("rise", -1)
    assert 1.0 < uav.position[2] < 2.0
    bench.run(3.0)
    assert manager.phase == "search"
    assert 2.4 < uav.position[2] < 3.1
    assert uav.asked == ["take_off_to", "hold", "hold"]


@pytest.mark.parametrize(("ground_m", "climbs"), [(0.0, True), (-20.0, False)])
def test_one_that_goes_on_near_the_ground_climbs_first(ground_m: float, climbs: bool) -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    bench.run(10.0)
    uav, manager = bench.uavs["uav1"], bench.managers["uav1"]
    bench.order("uav1", "hold")
    uav.position[2] = 0.8
    bench.run(1.0)
    uav.measure(0.8 - ground_m)
    bench.run(0.3)
    bench.order("uav1", "resume")
    bench.run(4.0)
    assert manager.phase == "search"
    assert (2.4 < uav.position[2] < 3.1) if climbs else uav.position[2] == 0.8


def test_what_a_sonar_measured_long_ago_makes_no_uav_climb() -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    bench.run(10.0)
    uav = bench.uavs["uav1"]
    bench.order("uav1", "hold")
    uav.measure(0.5)
    bench.run(2.0)
    bench.order("uav1", "resume")
    bench.run(4.0)
    assert uav.position[2] == 3.0


def test_one_that_is_landed_gives_its_sector_up_and_may_go_on() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    uav, manager = bench.uavs["uav1"], bench.managers["uav1"]
    left = manager.member.sector
    bench.order("uav1", "land")
    bench.run(3.0)
    assert not uav.flies
    assert (str(manager.phase), manager.member.sector) == ("done", -1)
    assert manager.problem == "landed by the operator"
    while not manager.member.searched[left]:  # by another one
        bench.run(1.0)
    assert not manager.member.searched.all()
    bench.order("uav1", "resume")
    bench.run(1.0)
    assert uav.flies
    bench.run(1.0)
    assert manager.member.sector >= 0


def test_orders_before_the_take_off_keep_it_down() -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    bench.run(1.0)
    with pytest.raises(GraphError, match="not in the air"):
        bench.order("uav1", "hold")
    assert bench.order("uav1", "land") == "stays on the ground until resume"
    bench.run(10.0)
    assert not bench.uavs["uav1"].flies
    bench.order("uav1", "resume")
    bench.run(5.0)
    assert bench.managers["uav1"].phase == "search"


def test_one_that_is_held_goes_home_by_order_or_with_a_low_battery() -> None:
    bench = TeamBench(HOMES)
    bench.run(15.0)
    for name in ("uav1", "uav2"):
        bench.order(name, "hold")
    bench.run(5.0)
    bench.uavs["uav2"].charge = 0.2
    assert bench.order("uav1", "return_home") == "goes home and lands"
    bench.run(1.0)
    assert bench.phases() == {"uav1": "return", "uav2": "return", "uav3": "search"}
    with pytest.raises(GraphError, match="battery"):
        bench.order("uav2", "resume")
    assert bench.order("uav1", "resume") == "searches"
    bench.run(1.0)
    assert bench.phases()["uav1"] == "search"


def test_one_that_was_landed_externally_says_so_and_gives_its_sector_up() -> None:
    """Its sonar shows that: its mission did not land it."""
    bench = TeamBench(HOMES)
    sonar = bench.graph.advertise("/uav3/range", "sensor_msgs/msg/Range")
    bench.run(10.0)
    manager, uav = bench.managers["uav3"], bench.uavs["uav3"]
    left = manager.member.sector
    bench.graph.call("/uav3/land")
    for _ in range(30):
        reading = zero_message("sensor_msgs/msg/Range")
        reading.range = -math.inf  # nearer than can be measured
        sonar.publish(reading)
        bench.run(0.1)
    assert (str(manager.phase), manager.member.sector) == ("down", -1)
    assert manager.problem == "came down, and not by its mission"
    bench.run(80.0)
    assert not uav.flies
    assert bench.managers["uav1"].member.searched[left]


def test_a_goal_of_the_explorer_that_comes_late_keeps_no_uav_from_home() -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    bench.run(15.0)
    bench.uavs["uav1"].charge = 0.2
    bench.run(0.4)
    assert bench.managers["uav1"].phase == "return"
    late = goal_at(np.array([70.0, 50.0, 3.0]), bench.clock.now_ns)
    bench.graph.advertise("/uav1/planning/goal", type(late)).publish(late)
    bench.run(45.0)  # by far less than it takes to give up
    assert bench.managers["uav1"].phase == "done"
    np.testing.assert_allclose(bench.uavs["uav1"].position[:2], HOMES["uav1"], atol=2.0)


def test_a_network_that_falls_apart_and_comes_together() -> None:
    bench = TeamBench(HOMES)
    bench.run(10.0)
    bench.is_connected = lambda _one, _other: False
    bench.run(40.0)
    alone = [manager.member.searched.copy() for manager in bench.managers.values()]
    assert not np.array_equal(alone[0], alone[2])
    bench.is_connected = lambda _one, _other: True
    bench.run(1.0)
    together = [manager.member.searched.tolist() for manager in bench.managers.values()]
    assert together[0] == together[1] == together[2]
    assert together[0] == np.logical_or.reduce(alone).tolist()
    sectors = [
        manager.member.sector for manager in bench.managers.values() if manager.member.sector >= 0
    ]
    assert len(set(sectors)) == len(sectors)


def test_a_late_comer_takes_its_part() -> None:
    bench = TeamBench({"uav1": HOMES["uav1"]})
    bench.run(30.0)
    bench.add("uav2", (80.0, 60.0))
    bench.run(10.0)
    assert bench.managers["uav2"].member.searched.any()
    assert bench.managers["uav2"].member.sector not in (-1, bench.managers["uav1"].member.sector)


def test_a_target_is_on_every_list_within_a_second() -> None:
    bench = TeamBench(HOMES, lost=0.3)
    bench.run(10.0)
    type_name = "volery_interfaces/msg/Targets"
    sees = bench.graph.advertise("/uav2/target_detection/targets", type_name)
    target = find("", 1, 33.0, bench.clock.now_ns).message()
    sees.publish(message_type(type_name)(header(bench.clock.now_ns, "map"), [target]))
    bench.run(1.0)
    for manager in bench.managers.values():
        (found,) = manager.member.targets.targets()
        assert (found.finder, found.position[0]) == ("uav2", 33.0)


def test_it_holds_while_it_does_not_know_where_it_is() -> None:
    bench = TeamBench({"uav1": (0.0, 0.0)})
    bench.run(10.0)
    bench.uavs["uav1"].silent = True
    bench.run(3.0)
    assert bench.managers["uav1"].problem == "no odometry"
    bench.uavs["uav1"].silent = False
    bench.run(1.0)
    assert bench.managers["uav1"].problem == ""


def test_it_waits_and_in_the_end_lands_where_its_position_in_the_map_is_lost() -> None:
    bench = TeamBench({})
    bench.add("uav1", (10.0, 0.0), use_map_tf=True)
    tf, publisher = (
        zero_message("geometry_msgs/msg/TransformStamped"),
        bench.graph.advertise("/tf", TFMessage),
    )
    tf.header.frame_id, tf.child_frame_id, tf.transform.rotation.w = "map", "map", 1.0
    uav, manager = bench.uavs["uav1"], bench.managers["uav1"]
    uav.frame = tf.child_frame_id = "uav1/odom"

    def run(seconds: float, placed: bool) -> None:
        for _ in range(round(2.0 * seconds)):
            if placed:
                tf.header = header(bench.clock.now_ns, "map")
                publisher.publish(TFMessage([tf]))
            bench.run(0.5)

    run(10.0, True)
    assert manager.problem == ""
    run(4.0, False)
    assert manager.problem == UNKNOWN_POSE
    assert uav.flies
    run(2.0, True)
    assert manager.problem == ""
    run(40.0, False)
    assert not uav.flies


def test_a_kept_state_is_all_that_a_manager_knows() -> None:
    bench, other = TeamBench(HOMES), TeamBench(HOMES, lost=1.0)
    bench.run(30.0)
    other.run(30.0)
    assert (
        bench.managers["uav1"].member.searched.sum() > other.managers["uav1"].member.searched.sum()
    )
    for name, manager in bench.managers.items():
        other.managers[name].set_state(copy.deepcopy(manager.get_state()))
        other.uavs[name].position = bench.uavs[name].position.copy()
        other.uavs[name].waypoints = list(bench.uavs[name].waypoints)
    other.is_connected = bench.is_connected = lambda _one, _other: False
    bench.run(20.0)
    other.run(20.0)
    for name, manager in bench.managers.items():
        assert manager.member.sector == other.managers[name].member.sector
        assert manager.member.searched.tolist() == other.managers[name].member.searched.tolist()


def test_a_uav_without_a_sector_waits_and_takes_over() -> None:
    """One sector for two: the other one hovers, until the first one fails."""
    bench = TeamBench({})
    for name, home in (("uav1", (30.0, 30.0)), ("uav2", (0.0, 0.0))):
        bench.add(name, home, sector_m=100.0)
    bench.run(10.0)
    assert bench.phases() == {"uav1": "search", "uav2": "idle"}
    bench.uavs["uav1"].charge = 0.1
    bench.run(2.0)
    assert bench.phases() == {"uav1": "return", "uav2": "search"}
    assert bench.uavs["uav2"].waypoints
    bench.managers["uav2"].member.searched[0] = True  # as if a report had said so
    bench.run(0.5)
    assert bench.phases()["uav2"] == "return"
    assert len(bench.uavs["uav2"].waypoints) == 1


def test_an_explorer_says_when_it_is_through() -> None:
    bench = TeamBench({"uav1": (0.0, 0.0)})
    bench.run(6.0)
    manager, sectors = bench.managers["uav1"], []
    says = bench.graph.advertise("/uav1/exploration/status", String)
    for state in ("done", "searching", "done", "blocked", "searching", "blocked", "{"):
        text = state if state == "{" else json.dumps({"state": state})
        says.publish(String(text))
        bench.run(0.3)
        sectors.append(manager.member.sector)
    first, second, third = sectors[0], sectors[2], sectors[5]
    assert sectors == [first, first, second, second, second, third, third]
    assert len({first, second, third}) == 3
    assert manager.member.searched.nonzero()[0].tolist() == [first]


@pytest.mark.parametrize("goes_on", [False, True])
def test_a_uav_that_disturbances_push_off_its_plans_lands_and_says_why(goes_on: bool) -> None:
    bench = TeamBench({"uav1": (0.0, 0.0)})
    bench.run(6.0)
    manager = bench.managers["uav1"]
    assert str(manager.phase) == "search"
    says = bench.graph.advertise("/uav1/planning/status", String)
    for second in range(18):
        fine = goes_on and second == 9
        says.publish(String(json.dumps({"problems": [] if fine else [TOO_DISTURBED]})))
        bench.run(1.0)
    says.publish(String("[" * 100_000))  # no status ends nothing
    if goes_on:
        assert (str(manager.phase), manager.problem) == ("search", "")
    else:
        assert str(manager.phase) in ("land", "done")
        assert manager.problem == BLOWN
        assert manager.member.sector == -1


def test_a_corrected_pose_is_one_in_the_map() -> None:
    bench = TeamBench({})
    bench.add("uav1", (10.0, 0.0), use_map_tf=True)
    tf = zero_message("geometry_msgs/msg/TransformStamped")
    tf.header.frame_id, tf.child_frame_id = "map", "map/odom"
    tf.transform.translation.x = 5.0
    tf.transform.rotation.z = tf.transform.rotation.w = 0.5**0.5  # a quarter turn to the left
    bench.graph.advertise("/tf", TFMessage).publish(TFMessage([tf]))
    bench.uavs["uav1"].frame = "map/odom"
    bench.run(1.0)
    reports = []
    bench.graph.subscribe("/uav1/team", reports.append)
    bench.run(0.5)
    position = reports[-1].message.position
    assert (position.x, position.y) == pytest.approx((5.0, 10.0))


def test_another_area_is_no_part_of_this_search() -> None:
    bench = TeamBench({"uav1": (0.0, 0.0)})
    bench.add("uav2", (0.0, 20.0), sector_m=30.0)
    bench.run(5.0)
    assert bench.managers["uav1"].problem == "another search: uav2"


def test_parameters_that_make_no_sense() -> None:
    with pytest.raises(GraphError, match="area_m must be"):
        TeamBench({}).add("uav1", (0.0, 0.0), area_m=[0.0, 0.0, 0.0, 5.0])
    with pytest.raises(GraphError, match="2 is beyond 0 to 1"):
        TeamBench({}).add("uav1", (0.0, 0.0), coverage_fraction=2.0)
