"""Robustness of temporal formulas, against its definition and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_runs import flight_of, line, run_of

from volery.scenario.formulas import Comparison, Connective, Temporal, is_invariant, parse_formula
from volery.verdicts import Outcome
from volery.verdicts.judging import Judge

RATE_HZ = 2.0


def verdict_on(flight, formula, **keys):
    run = run_of(flight, {"kind": "formula", "formula": formula, **keys})
    (verdict,) = Judge(run.scenario).verdicts(run)
    return verdict


def robustness(node, heights, k):
    """The definition, sample by sample, for comparisons of z with a number."""
    if isinstance(node, Comparison):
        terms = [heights[k] if hasattr(t, "name") else t.value for t in (node.left, node.right)]
        return terms[0] - terms[1]
    if isinstance(node, Connective):
        values = [robustness(part, heights, k) for part in node.parts]
        if node.operator == "not":
            return -values[0]
        return min(values) if node.operator == "and" else max(values)
    assert isinstance(node, Temporal)
    a, b = (min(t * RATE_HZ, len(heights)) for t in node.interval_s)
    window = range(k + math.ceil(a), min(k + math.floor(b), len(heights) - 1) + 1)
    if node.operator == "until":
        first, second = node.parts
        return max(
            (
                min(
                    [robustness(second, heights, i)]
                    + [robustness(first, heights, j) for j in range(k, i)]
                )
                for i in window
            ),
            default=-math.inf,
        )
    values = [robustness(node.parts[0], heights, i) for i in window]
    if node.operator == "always":
        return min(values, default=math.inf)
    return max(values, default=-math.inf)


def last_begin(node):
    """Returns the last sample at which a window begins."""
    if isinstance(node, Comparison):
        return 0
    begin = node.interval_s[0] * RATE_HZ if isinstance(node, Temporal) else 0
    return begin + max(map(last_begin, node.parts))


ATOMS = st.sampled_from(["z > 1", "z < 2", "z >= 3", "z <= 0.5"])
WINDOWS = st.tuples(st.integers(0, 4), st.integers(0, 6)).map(
    lambda w: f", {w[0] / RATE_HZ}, {(w[0] + w[1]) / RATE_HZ}"
) | st.just("")
FORMULAS = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.builds("always({}{})".format, inner, WINDOWS),
        st.builds("eventually({}{})".format, inner, WINDOWS),
        st.builds("until({}, {}{})".format, inner, inner, WINDOWS),
        st.builds("not ({})".format, inner),
        st.builds("({}) and ({})".format, inner, inner),
        st.builds("implies({}, {})".format, inner, inner),
    ),
    max_leaves=6,
)


@given(formula=FORMULAS, heights=st.lists(st.integers(-3, 3).map(float), min_size=2, max_size=12))
def test_robustness_is_that_of_the_definition(formula, heights):
    path = np.zeros((1, len(heights), 3))
    path[0, :, 2] = heights
    verdict, parsed = verdict_on(flight_of(path, rate_hz=RATE_HZ), formula), parse_formula(formula)
    expected = robustness(parsed, heights, 0)
    if math.isinf(expected) or last_begin(parsed) >= len(heights):
        assert verdict.outcome is Outcome.ERROR
        return
    assert verdict.margin == expected
    assert verdict.is_passed is (expected >= 0.0)


CLIMB = line([0.0, 0.0, 0.0], [0.0, 0.0, 10.0], 101)  # 1 m/s at 10 Hz


def test_the_sample_that_decides():
    flight = flight_of([CLIMB, CLIMB * 0.5])
    verdict = verdict_on(flight, "eventually(z > 4, 0, 6)")
    assert verdict.outcome is Outcome.FAILED
    assert (verdict.uav, verdict.margin) == ("uav2", pytest.approx(-1.0))
    assert verdict.time_s == pytest.approx(6.0)
    alone = verdict_on(flight, "always(z > 4, 5, 10)", uavs=["uav1"])
    assert alone.margin == pytest.approx(1.0)
    assert alone.time_s == pytest.approx(5.0)
    between = verdict_on(flight, "always(z > 4, 5.05, 10)", uavs=["uav1"])
    assert between.time_s == pytest.approx(5.1)  # the first sample in the window


def test_signals_and_arithmetic():
    flight = flight_of([CLIMB, CLIMB + np.array([3.0, 0.0, 0.0])])
    assert verdict_on(flight, "always(abs(vz - 1) < 0.1 and separation == 3)").is_passed
    assert verdict_on(flight, "always(max(x, y, z) - min(z, 0) <= t + 3)").is_passed
    tilted = np.tile([np.sin(np.pi / 12), 0.0, 0.0, np.cos(np.pi / 12)], (1, 101, 1))
    leaning = flight_of([CLIMB], attitude=tilted)
    assert verdict_on(leaning, "always(29.9 < tilt_deg < 30.1 and battery >= 1)").is_passed
    assert verdict_on(leaning, "eventually(speed > 1.5)").outcome is Outcome.FAILED


def test_samples_before_a_uav_exists_do_not_count():
    late = CLIMB.copy()
    late[:40] = np.nan
    assert verdict_on(flight_of([late]), "always(z > 3.9)").is_passed


def test_numbers_that_are_none_are_an_error():
    battery = np.full((1, 101), np.nan)
    verdict = verdict_on(flight_of([CLIMB], battery_charge=battery), "battery > 0.5")
    assert (verdict.outcome, verdict.uav) == (Outcome.ERROR, "")
    assert "not a number" in verdict.text


@pytest.mark.parametrize(
    ("formula", "reason"),
    [
        ("always(z > 2, 30, 40)", "a window begins after 30 s, the flight ends after 10 s"),
        ("z > -1 and always(z > 2, 30, 40)", "a window begins after 30 s"),
        ("always(eventually(z > 1, 6, 7), 5, 5)", "a window begins after 11 s"),
        ("always(eventually(z > 1, 2, 3))", "a window that moves beyond the end"),
        ("z / 0 > 1", "not a number"),
        ("1 / z > 1", "a division by zero"),
        ("separation > 1", "the separation of a UAV without others"),
    ],
)
def test_formulas_that_cannot_be_judged_are_errors(formula, reason):
    verdict = verdict_on(flight_of([CLIMB]), formula)
    assert verdict.outcome is Outcome.ERROR
    assert reason in verdict.text


@pytest.mark.parametrize(
    ("formula", "reason"),
    [
        ("always(hight > 1)", "no signal 'hight'"),
        ("always(altitude > 1)", "no signal 'altitude'; did you mean 'z'?"),
        ("z", "is no formula"),
        ("always(z > 1, 5, 2)", "5 s is after 2 s"),
        ("always(z > 1, x, 2)", "times are numbers"),
        ("eventually(z > 1, 3)", "write eventually(f, a, b)"),
        ("z > 1 > ", "cannot be read"),
        ("z > 2)) and z", "cannot be read at ')) and z': unmatched"),
        ("__import__('os').system('true') > 1", "is no term"),
        ("z != 1", "compare with"),
        ("z > True", "is no term"),
        ("z ** 2 > 1", "is no term"),
        (" and ".join(["z > 1"] * 400), "too long"),
        ("not " * 100_000 + "z > 1", "nested too deeply"),
    ],
)
def test_formulas_that_are_refused(formula, reason):
    with pytest.raises(ValueError, match=reason.replace("(", r"\(").replace(")", r"\)")):
        parse_formula(formula)


@pytest.mark.parametrize(
    ("formula", "is_final"),
    [
        ("z > 1", True),
        ("always(z > 1 or x < 2) and y < 3", True),
        ("eventually(z > 1)", False),
        ("always(z > 1) and eventually(x > 2)", False),
        ("always(eventually(z > 1, 0, 2))", False),
        ("not always(z > 1)", False),
        ("until(z > 1, x > 2)", False),
    ],
)
def test_failures_that_are_final(formula, is_final):
    assert is_invariant(parse_formula(formula)) is is_final


def test_the_text_names_the_comparison_that_decides():
    flight = flight_of([CLIMB])
    falls = verdict_on(flight, "always(z < 20) and (eventually(x > 3) or not z < 2.5)")
    assert falls.text == "robustness -2.5 of z < 2.5"
    chained = verdict_on(flight, "always(-1 < z <= 9, 0, 10)")
    assert (chained.text, chained.time_s) == ("robustness -1 of z <= 9", pytest.approx(10.0))
