"""Predicates: functions of users as expectations, and what they need to run."""

from __future__ import annotations

import math
import sys
import textwrap

import pytest
from made_runs import flight_of, line, run_of

from volery.core.errors import ScenarioError
from volery.scenario.load import load_scenario, parse_scenario
from volery.verdicts import Outcome, judged_flight
from volery.verdicts.judging import Judge

EAST = line([0.0, 0.0, 3.0], [10.0, 0.0, 3.0], 101)


def climbs(flight, min_height_m):
    return float(flight.position_map[0, -1, 2]) - min_height_m


def is_far(flight):
    return flight.distance_m[0] > 5.0


def breaks(flight):
    raise ValueError("a reason")


def exits(flight):
    raise SystemExit(0)


def writes(flight):
    flight.position_map[:] = 0.0
    return True


def says_nothing(flight):
    return None


def is_nan(flight):
    return math.nan


def wants_more(flight, colour):
    return True


def climbs_by_odometry(topics):
    heights = {name: odom.messages[-1].pose.pose.position.z for name, odom in topics.items()}
    assert len(topics["/uav1/odom"].times_s) == len(topics["/uav1/odom"].messages) > 20
    return min(heights.values()) - 0.5


def expectation(function, **keys):
    return {"kind": "predicate", "function": f"{__name__}:{function}", **keys}


def verdict_on(*words, **keys):
    run = run_of(flight_of([EAST]), expectation(*words, **keys))
    (verdict,) = Judge(run.scenario).verdicts(run)
    return verdict


def test_a_number_is_a_margin_and_a_bool_has_none():
    verdict = verdict_on("climbs", parameters={"min_height_m": 5.0})
    assert (verdict.outcome, verdict.margin) == (Outcome.FAILED, -2.0)
    far = verdict_on("is_far")
    assert (far.is_passed, far.text) == (True, "true")


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        ("breaks", "ValueError: a reason (test_predicates.py:"),
        ("exits", "SystemExit: 0"),
        ("writes", "read-only"),
        ("says_nothing", "NoneType"),
        ("is_nan", "NaN"),
    ],
)
def test_functions_that_fail_are_errors(function, reason):
    verdict = verdict_on(function)
    assert verdict.outcome is Outcome.ERROR
    assert reason in verdict.text


@pytest.mark.parametrize(
    ("function", "keys", "reason"),
    [
        ("missing", {}, "is no function"),
        ("climb", {}, "is no function; did you mean 'climbs'?"),
        ("wants_more", {}, "parameter 'colour'"),
        ("is_far", {"parameters": {"speed": 3}}, "has no parameter 'speed', which has a value"),
        ("climbs", {"parameters": {"min_hight_m": 3}}, "did you mean 'min_height_m'?"),
        ("climbs_by_odometry", {}, "reads topics: name them in 'topics'"),
    ],
)
def test_functions_that_do_not_fit_are_refused(function, keys, reason):
    run = run_of(flight_of([EAST]), expectation(function, **keys))
    with pytest.raises(ScenarioError, match=reason):
        Judge(run.scenario)


@pytest.fixture
def written(tmp_path):
    """A scenario file with a predicate beside it that leaves a trace when it is imported."""
    (tmp_path / "own_checks.py").write_text(
        "import pathlib\npathlib.Path(__file__).with_name('trace').touch()\n"
        "def high(flight):\n    return flight.position_map[0, -1, 2] > 1.0\n"
    )
    path = tmp_path / "hop.toml"
    path.write_text(
        textwrap.dedent("""
        name = "hop"
        duration_s = 4.0
        [types.bird]
        airframe = "f450"
        [[uavs]]
        type = "bird"
        position_m = [0.0, 0.0]
        on_start = "take_off"
        [[expect]]
        kind = "predicate"
        function = "own_checks:high"
        """)
    )
    sys.modules.pop("own_checks", None)
    yield path
    sys.modules.pop("own_checks", None)


def test_a_trusted_file_runs_code_beside_it(written):
    judged = judged_flight(load_scenario(written, trust=True))
    assert judged.is_passed
    assert (written.parent / "trace").exists()


@pytest.mark.parametrize(
    "function", ["own_checks:high", "os:system", "volery.core.machine:usable_cores"]
)
def test_a_file_without_trust_runs_none(written, function):
    written.write_text(written.read_text().replace("own_checks:high", function))
    with pytest.raises(ScenarioError, match="give --trust"):
        Judge(load_scenario(written))
    assert not (written.parent / "trace").exists()


def test_a_confined_scenario_runs_none(written):
    from dataclasses import replace

    scenario = load_scenario(written, trust=True)
    confined = scenario.with_access(replace(scenario.access, is_confined=True))
    with pytest.raises(ScenarioError, match="own_checks:high"):
        Judge(confined)
    assert not (written.parent / "trace").exists()


def test_expecting_adds_to_a_scenario():
    data = {
        "name": "still",
        "duration_s": 1.0,
        "types": {"bird": {"airframe": "f450"}},
        "uavs": [{"type": "bird", "position_m": [0.0, 0.0]}],
    }
    scenario = parse_scenario(data, where="still")
    more = scenario.expecting("no_contact").expecting("speed", at_most_m_s=0.1)
    assert scenario.expect == ()
    assert [each.kind for each in more.expect] == ["no_contact", "speed"]
    judged = judged_flight(more)
    assert judged.is_passed
    assert [verdict.name for verdict in judged.verdicts] == ["no contact", "speed <= 0.1 m/s"]
    with pytest.raises(ScenarioError, match="at_most_m_s"):
        scenario.expecting("speed", at_most_m_s=-1.0)
    with pytest.raises(ScenarioError, match="kind"):
        scenario.expecting("nothing")


def test_a_function_reads_messages():
    hop = {
        "name": "hop",
        "duration_s": 1.5,
        "types": {"bird": {"airframe": "f450", "sensors": [{"kind": "odometry"}]}},
        "uavs": [{"type": "bird", "position_m": [0.0, 0.0], "on_start": "take_off"}],
        "expect": [expectation("climbs_by_odometry", topics=["odom"])],
    }
    (verdict,) = judged_flight(parse_scenario(hop)).verdicts
    assert verdict.outcome is Outcome.PASSED, verdict.text
    assert 0.0 < verdict.margin < 2.0


def test_an_unknown_uav_is_an_error():
    verdict = verdict_on("is_far", uavs=["uav7"])
    assert (verdict.outcome, verdict.text) == (Outcome.ERROR, "no UAV 'uav7'; did you mean 'uav1'?")


def test_a_flight_can_be_changed_again_afterwards():
    run = run_of(flight_of([EAST]), expectation("is_far"))
    Judge(run.scenario).verdicts(run)
    run.flight.position_map[0, 0, 0] = 1.0


def test_a_topic_that_never_comes_is_named():
    hop = {
        "name": "hop",
        "duration_s": 0.5,
        "types": {"bird": {"airframe": "f450", "sensors": [{"kind": "odometry"}]}},
        "uavs": [{"type": "bird", "position_m": [0.0, 0.0]}],
        "expect": [
            expectation("climbs_by_odometry", topics=["odmo"]),
            {"kind": "topic_value", "topic": "odmo", "field": "child_frame_id", "equals": ""},
        ],
    }
    for verdict in judged_flight(parse_scenario(hop)).verdicts:
        assert "no message on /uav1/odmo; did you mean '/uav1/odom'?" in verdict.text
