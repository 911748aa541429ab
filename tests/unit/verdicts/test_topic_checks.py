"""Expectations about topics, estimates and logs, judged on made-up records."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from made_runs import flight_of, line, run_of

from volery.verdicts import Outcome
from volery.verdicts.judging import Judge
from volery.verdicts.observing import MISSING, Estimate, TopicRecord, value_at

EAST = line([0.0, 0.0, 3.0], [10.0, 0.0, 3.0], 101)  # 1 m/s for 10 s


def verdict_on(expectation, *, paths=(EAST,), **parts):
    run = run_of(flight_of(list(paths)), expectation, **parts)
    (verdict,) = Judge(run.scenario).verdicts(run)
    return verdict


def record(times_s, **values):
    return TopicRecord(list(times_s), {key: list(column) for key, column in values.items()})


def test_the_rate_is_that_of_the_slowest_window():
    times = [t / 10 for t in range(100) if not 40 <= t < 47]
    topics = {"/uav1/odom": record(times)}
    expectation = {"kind": "topic_rate", "topic": "odom", "at_least_hz": 10.0}
    verdict = verdict_on(expectation, topics=topics)
    assert (verdict.outcome, verdict.unit) == (Outcome.FAILED, "Hz")
    assert verdict.margin == pytest.approx(-7.0)
    assert verdict.time_s == pytest.approx(4.0)
    assert verdict_on({**expectation, "from_s": 5.0}, topics=topics).is_passed
    assert verdict_on(
        {**expectation, "window_s": 10.0, "at_least_hz": 9.3}, topics=topics
    ).is_passed


def test_a_topic_that_never_comes_fails():
    rate = verdict_on({"kind": "topic_rate", "topic": "slam/pose", "at_least_hz": 5.0})
    assert (rate.outcome, rate.margin) == (Outcome.FAILED, -5.0)
    assert "no message on /uav1/slam/pose" in rate.text
    value = verdict_on({"kind": "topic_value", "topic": "/status", "equals": "done"})
    assert (value.outcome, value.text) == (Outcome.FAILED, "no message on /status")


HEIGHTS = {"/uav1/odom": record([1.0, 2.0, 3.0], z=[0.0, 4.0, 2.0])}


@pytest.mark.parametrize(
    ("keys", "passed", "margin", "time_s"),
    [
        ({"at_least": 3.0}, True, 1.0, 2.0),
        ({"at_least": 1.0}, True, 3.0, 2.0),
        ({"at_least": 5.0}, False, -1.0, 2.0),
        ({"at_most": 3.0, "when": "always"}, False, -1.0, 2.0),
        ({"at_least": 1.5, "at_most": 3.0, "when": "at_end"}, True, 0.5, 3.0),
        ({"at_least": 1.0, "until_s": 1.5}, False, -1.0, 1.0),
        ({"at_least": 1.0, "from_s": 1.5, "when": "always"}, True, 1.0, 3.0),
    ],
)
def test_values_of_a_field(keys, passed, margin, time_s):
    expectation = {"kind": "topic_value", "topic": "odom", "field": "z", **keys}
    verdict = verdict_on(expectation, topics=HEIGHTS)
    assert (verdict.is_passed, verdict.margin) == (passed, pytest.approx(margin))
    assert (verdict.time_s, verdict.uav) == (time_s, "uav1")


def test_a_window_after_the_end_cannot_be_judged():
    late = {"kind": "topic_value", "topic": "odom", "field": "z", "at_least": 1.0, "from_s": 60.0}
    verdict = verdict_on(late, topics=HEIGHTS)
    assert verdict.outcome is Outcome.ERROR
    assert "before 60 s" in verdict.text


def test_equal_values_have_no_margin():
    topics = {"/status": record([0.5, 1.5], **{"data.phase": ["search", "cruise"]})}
    expectation = {
        "kind": "topic_value",
        "topic": "/status",
        "field": "data.phase",
        "equals": "cruise",
    }
    verdict = verdict_on(expectation, topics=topics)
    assert verdict.is_passed
    assert (verdict.time_s, verdict.uav) == (1.5, "")
    assert math.isnan(verdict.margin)
    assert not verdict_on({**expectation, "when": "always"}, topics=topics).is_passed
    whole = verdict_on(expectation, topics={"/status": record([0.5], **{"data.phase": [topics]})})
    assert whole.outcome is Outcome.ERROR
    assert "neither a number nor a text" in whole.text


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (MISSING, "has no field 'z'"),
        (float("nan"), "not a number"),
        ("high", "is high, which is no number"),
        (SimpleNamespace(x=1.0), "z of /uav1/odom is a SimpleNamespace, which is no number"),
    ],
)
def test_values_that_cannot_be_compared_are_errors(value, reason):
    topics = {"/uav1/odom": record([1.0], z=[value])}
    expectation = {"kind": "topic_value", "topic": "odom", "field": "z", "at_least": 1.0}
    verdict = verdict_on(expectation, topics=topics)
    assert verdict.outcome is Outcome.ERROR
    assert reason in verdict.text


def test_each_uav_has_its_topic():
    topics = {"/uav1/odom": record([1.0], z=[2.0]), "/uav2/odom": record([1.0], z=[1.0])}
    expectation = {"kind": "topic_value", "topic": "odom", "field": "z", "at_least": 1.5}
    verdict = verdict_on(expectation, paths=(EAST, EAST + 5.0), topics=topics)
    assert (verdict.outcome, verdict.uav) == (Outcome.FAILED, "uav2")
    assert verdict_on({**expectation, "uavs": ["uav1"]}, topics=topics).is_passed


def test_a_silent_uav_decides_beside_one_with_a_margin():
    topics = {"/uav1/odom": record([1.0], z=[2.0])}
    expectation = {"kind": "topic_value", "topic": "odom", "field": "z", "at_least": 1.5}
    verdict = verdict_on(expectation, paths=(EAST, EAST + 5.0), topics=topics)
    assert (verdict.outcome, verdict.uav) == (Outcome.FAILED, "uav2")


def test_paths_of_fields():
    pose = SimpleNamespace(position=SimpleNamespace(z=2.5))
    message = SimpleNamespace(pose=pose, ranges=np.array([3.0, 4.0]), data='{"a": {"b": [1, 2]}}')
    assert value_at(message, "pose.position.z") == 2.5
    assert value_at(message, "ranges.1") == 4.0
    assert value_at(message, "data.a.b.0") == 1
    for path in ("pose.x", "ranges.2", "data.a.c", "data.a.b.0.1", "pose.position.z.w"):
        assert value_at(message, path) is MISSING
    assert value_at(SimpleNamespace(data="no JSON"), "data.a") is MISSING


def test_messages_of_an_undone_flight_are_dropped():
    kept = record([], z=[])
    for time_s, z in ((1.0, 1.0), (2.0, 2.0), (3.0, 3.0), (2.0, 7.0)):
        kept.add(time_s, SimpleNamespace(z=z))
    assert kept.times_s == [1.0, 2.0]
    assert kept.values["z"] == [1.0, 7.0]


def estimate_of(path, *, sigma_m=0.1, turned=False):
    """Estimates at 5 Hz, in a frame of their own if `turned`."""
    times = np.arange(0.0, 10.0, 0.2)
    position = path[:-1:2].copy()
    if turned:
        position = position[:, [1, 0, 2]] * [1.0, -1.0, 1.0] + [5.0, 3.0, 0.0]
    variance = np.broadcast_to(np.square(sigma_m), 3)
    covariance = np.tile(np.diag(variance), (len(times), 1, 1))
    attitude = np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1))
    if turned:  # the frame is turned to the right: the body is turned to the left in it
        attitude[:, 2:] = np.sqrt(0.5) * np.array([-1.0, 1.0])
        covariance = covariance[:, [1, 0, 2]][:, :, [1, 0, 2]]
    return {"uav1": Estimate(times, position, attitude, covariance)}


CURVE = np.stack(
    [np.linspace(0.0, 10.0, 101), 3.0 * np.sin(np.linspace(0.0, 6.0, 101)), np.full(101, 3.0)], 1
)


def test_estimates_are_aligned_before_they_are_compared():
    expectation = {"kind": "estimate_error", "at_most_m": 0.01}
    verdict = verdict_on(expectation, paths=(CURVE,), estimates=estimate_of(CURVE, turned=True))
    assert verdict.is_passed
    bent = CURVE * [1.0, 1.2, 1.0]
    wrong = verdict_on(expectation, paths=(CURVE,), estimates=estimate_of(bent))
    assert (wrong.outcome, wrong.uav) == (Outcome.FAILED, "uav1")
    assert wrong.margin < -0.1


def test_nees_is_three_for_a_consistent_estimate():
    rng = np.random.default_rng(1)
    sigma_m = np.array([0.3, 0.1, 0.1])
    noisy = CURVE + rng.normal(0.0, sigma_m, CURVE.shape)
    noisy[0] = CURVE[0]  # it begins at its start
    expectation = {"kind": "nees", "at_most": 4.0, "at_least": 2.0}
    for turned in (False, True):
        estimates = estimate_of(noisy, sigma_m=sigma_m, turned=turned)
        assert verdict_on(expectation, paths=(CURVE,), estimates=estimates).is_passed
    proud = verdict_on(expectation, paths=(CURVE,), estimates=estimate_of(noisy, sigma_m=0.01))
    shy = verdict_on(expectation, paths=(CURVE,), estimates=estimate_of(noisy, sigma_m=1.0))
    assert (proud.outcome, shy.outcome) == (Outcome.FAILED, Outcome.FAILED)
    assert proud.margin < -100.0
    none = verdict_on(expectation, paths=(CURVE,), estimates=estimate_of(noisy, sigma_m=math.nan))
    assert (none.outcome, none.text) == (Outcome.ERROR, "uav1: its estimate has no covariance")


def test_without_estimates():
    verdict = verdict_on({"kind": "estimate_error", "at_most_m": 1.0}, estimates={})
    assert verdict.outcome is Outcome.ERROR
    assert "slam/pose" in verdict.text


def test_log_messages():
    columns = {"level": [20, 30], "name": ["uav1.slam", "uav1.slam"], "msg": ["start", "lost"]}
    topics = {"/rosout": record([0.0, 4.0], **columns)}
    verdict = verdict_on({"kind": "no_log_message"}, topics=topics)
    assert (verdict.outcome, verdict.time_s) == (Outcome.FAILED, 4.0)
    assert verdict.text == "[uav1.slam] lost"
    for keys in ({"level": "error"}, {"contains": "found"}, {"uavs": ["uav2"]}):
        assert verdict_on({"kind": "no_log_message", **keys}, topics=topics).is_passed


def test_the_real_time_factor():
    expectation = {"kind": "real_time_factor", "at_least": 4.0}
    assert verdict_on(expectation, wall_s=2.0).margin == pytest.approx(1.0)
    assert verdict_on(expectation, wall_s=5.0).outcome is Outcome.FAILED
