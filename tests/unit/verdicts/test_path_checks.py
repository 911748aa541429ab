"""Expectations about paths, modes and batteries, judged on made-up flights."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made_runs import RADIUS_M, Posts, event_of, flight_of, line, run_of

from volery.control.flight_modes import FlightMode
from volery.verdicts import Outcome
from volery.verdicts.judging import Judge


def verdict_on(flight, expectation, **parts):
    run = run_of(flight, expectation, **parts)
    (verdict,) = Judge(run.scenario).verdicts(run)
    return verdict


STILL = np.tile([[0.0, 0.0, 3.0]], (51, 1))
EAST = line([0.0, 0.0, 3.0], [10.0, 0.0, 3.0], 51)  # 2 m/s for 5 s


def test_no_contact_gives_the_nearest_approach():
    flight = flight_of([EAST])
    verdict = verdict_on(flight, {"kind": "no_contact"}, scene=Posts([[6.0, 1.5]]))
    assert verdict.is_passed
    assert verdict.margin == pytest.approx(1.5 - RADIUS_M)
    assert (verdict.uav, verdict.time_s) == ("uav1", pytest.approx(3.0))


def test_no_contact_counts_other_uavs():
    verdict = verdict_on(
        flight_of([STILL, STILL + np.array([2.0, 0.0, 0.0])]), {"kind": "no_contact"}
    )
    assert verdict.margin == pytest.approx(2.0 - 2 * RADIUS_M)
    assert "uav2" in verdict.text


def test_a_contact_fails_by_its_speed():
    hit = event_of(2.5, "uav1", "collision", speed_m_s=4.0, partner="tree 3")
    landed = event_of(1.0, "uav1", "touch_down", speed_m_s=0.3)
    flight = flight_of([EAST, STILL], events=(landed, hit))
    verdict = verdict_on(flight, {"kind": "no_contact"})
    assert verdict.outcome is Outcome.FAILED
    assert (verdict.margin, verdict.time_s, verdict.uav) == (-4.0, 2.5, "uav1")
    assert "hit tree 3" in verdict.text
    assert verdict_on(flight, {"kind": "no_contact", "uavs": ["uav2"]}).is_passed


def test_no_crash():
    mode = np.full((2, 51), 2, np.int8)
    mode[1, 30:] = 8
    verdict = verdict_on(flight_of([EAST, STILL], mode=mode), {"kind": "no_crash"})
    assert verdict.outcome is Outcome.FAILED
    assert (verdict.uav, verdict.time_s) == ("uav2", pytest.approx(3.0))
    assert verdict_on(flight_of([EAST]), {"kind": "no_crash"}).is_passed


@pytest.mark.parametrize(
    ("keys", "passed", "margin"),
    [
        ({"position_m": [10.0, 0.0]}, True, 1.0),
        ({"position_m": [10.0, 0.0, 5.0]}, False, -1.0),
        ({"position_m": [10.0, 0.0], "by_s": 2.5}, False, -4.0),
        ({"position_m": [10.0, 3.0], "within_m": 4.0}, True, 1.0),
    ],
)
def test_arrival(keys, passed, margin):
    verdict = verdict_on(flight_of([EAST]), {"kind": "arrives", **keys})
    assert verdict.is_passed is passed
    assert verdict.margin == pytest.approx(margin)


def test_the_last_to_arrive_decides():
    verdict = verdict_on(
        flight_of([EAST, np.concatenate([STILL[:26], EAST[::2][:25]])]),
        {"kind": "arrives", "position_m": [9.0, 0.0], "within_m": 1.0},
    )
    assert verdict.is_passed
    assert verdict.uav == "uav2"
    assert verdict.time_s > 4.0


def test_separation_within_a_window():
    flight = flight_of([EAST, STILL + np.array([10.0, 2.0, 0.0])])
    whole = verdict_on(flight, {"kind": "separation", "at_least_m": 3.0})
    assert whole.outcome is Outcome.FAILED
    assert whole.margin == pytest.approx(-1.0)
    assert whole.time_s == pytest.approx(5.0)
    early = verdict_on(flight, {"kind": "separation", "at_least_m": 3.0, "until_s": 2.0})
    assert early.is_passed
    alone = verdict_on(flight_of([EAST]), {"kind": "separation", "at_least_m": 3.0})
    assert (alone.outcome, alone.text) == (Outcome.ERROR, "the flight has one UAV only")


def test_clearance():
    expectation = {"kind": "clearance", "at_least_m": 1.0}
    verdict = verdict_on(flight_of([EAST]), expectation, scene=Posts([[4.0, 0.5]]))
    assert verdict.outcome is Outcome.FAILED
    assert verdict.margin == pytest.approx(-0.5)
    later = {**expectation, "from_s": 3.0}
    assert verdict_on(flight_of([EAST]), later, scene=Posts([[4.0, 0.5]])).is_passed
    far = verdict_on(flight_of([EAST]), expectation, scene=Posts([[4.0, 90.0]]))
    assert (far.text, far.margin) == ("10.00 m or more", 9.0)


@pytest.mark.parametrize(
    ("keys", "margin"),
    [
        ({"region_m": [-1.0, -2.0, 12.0, 2.0]}, 1.0),
        ({"region_m": [-1.0, -2.0, 9.0, 2.0]}, -1.0),
        ({"height_m": [2.5, 10.0]}, 0.5),
        ({"corridor_m": [[0.0, 1.0], [5.0, 1.0], [20.0, 1.0]], "radius_m": 1.5}, 0.5),
        ({"corridor_m": [[0.0, 0.0], [6.0, 0.0]], "radius_m": 1.5}, -2.5),
        ({"region_m": [-1.0, -2.0, 12.0, 2.0], "height_m": [2.5, 10.0]}, 0.5),
    ],
)
def test_limits(keys, margin):
    verdict = verdict_on(flight_of([EAST]), {"kind": "inside", **keys})
    assert verdict.margin == pytest.approx(margin)
    assert verdict.is_passed is (margin >= 0.0)


def test_speed_and_battery():
    charge = np.linspace(1.0, 0.5, 51)[None]
    flight = flight_of([EAST], battery_charge=charge)
    fast = verdict_on(flight, {"kind": "speed", "at_most_m_s": 1.5})
    assert (fast.outcome, fast.unit) == (Outcome.FAILED, "m/s")
    assert fast.margin == pytest.approx(-0.5)
    low = verdict_on(flight, {"kind": "battery", "at_least": 0.4})
    assert low.margin == pytest.approx(0.1)
    assert low.time_s == pytest.approx(5.0)


def test_modes_in_order():
    """What is commanded is in the samples; what a UAV does by itself is also an event."""
    changes = [(0.0, "LANDED"), (0.5, "TAKE_OFF"), (2.04, "HOLD"), (3.0, "LAND"), (4.54, "LANDED")]
    events = tuple(
        event_of(t, "uav1", "mode", detail=f"changed to {m}")
        for t, m in changes
        if t in (2.04, 4.54)
    )
    numbers = np.zeros((1, 51), np.int8)
    for time_s, mode in changes:
        numbers[0, np.arange(51) / 10.0 >= time_s] = FlightMode[mode]
    flight = flight_of([STILL], events=events, mode=numbers)
    expected = {"kind": "modes", "modes": ["landed", "take_off", "landed"], "by_s": 5.0}
    verdict = verdict_on(flight, expected)
    assert verdict.is_passed
    assert (verdict.margin, verdict.time_s) == (pytest.approx(0.46), 4.54)
    order = ["landed", "take_off", "hold", "land", "landed"]
    assert verdict_on(flight, {"kind": "modes", "modes": order}).is_passed
    assert verdict_on(flight, {**expected, "by_s": 4.0}).outcome is Outcome.FAILED
    endless = verdict_on(flight, {"kind": "modes", "modes": ["hold"]})
    assert endless.is_passed
    assert math.isnan(endless.margin)
    wrong = verdict_on(flight, {"kind": "modes", "modes": ["land", "hold"]})
    assert (wrong.outcome, wrong.text) == (Outcome.FAILED, "never hold")


def test_a_failsafe_is_a_mode_change():
    event = event_of(1.0, "uav1", "mode", detail="changed to RETURN: battery low")
    flight = flight_of([STILL], events=(event,))
    assert verdict_on(flight, {"kind": "modes", "modes": ["hold", "return"]}).is_passed


def test_area():
    verdict = verdict_on(flight_of([EAST]), {"kind": "area", "at_least_m2": 40.0})
    assert verdict.is_passed
    assert verdict_on(flight_of([EAST]), {"kind": "area", "at_least_m2": 80.0}).margin < 0.0


def test_what_cannot_be_judged_is_an_error():
    unknown = verdict_on(flight_of([EAST]), {"kind": "no_contact", "uavs": ["uav7"]})
    assert unknown.outcome is Outcome.ERROR
    assert "no UAV 'uav7'; did you mean 'uav1'?" in unknown.text
    late = verdict_on(flight_of([EAST]), {"kind": "speed", "at_most_m_s": 3.0, "from_s": 60.0})
    assert (late.outcome, late.text) == (Outcome.ERROR, "the flight ended at 5 s, before 60 s")


def test_a_verdict_survives_json():
    import json

    from volery.verdicts import Verdict

    verdict = verdict_on(flight_of([EAST]), {"kind": "modes", "modes": ["hold"]})
    again = Verdict.from_data(json.loads(json.dumps(verdict.to_data())))
    assert again.to_data() == verdict.to_data()
    assert math.isnan(again.margin)
