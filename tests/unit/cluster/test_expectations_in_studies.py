"""Verdicts as a metric of a study."""

from __future__ import annotations

import pytest
from studies import TINY

from volery.cluster.errors import StudyError
from volery.cluster.loading import load_study
from volery.cluster.study_runs import SweepOptions, fly_runs
from volery.verdicts.verdict import Verdict

EXPECT = [{"kind": "no_contact"}, {"kind": "speed", "at_most_m_s": 1.2, "from_s": 0.1}]
STUDY = {
    **TINY,
    "metrics": ["expectations", "distance_m"],
    "changes": {**TINY["changes"], "expect": EXPECT},
}


def flown(study, folder, **options):
    return fly_runs(load_study(study), SweepOptions(folder, 0, **options))


def test_columns_hold_margins_and_whether_all_passed(tmp_path):
    plan = flown(STUDY, tmp_path / "out")
    for run in plan.wanted():
        result = plan.results[run.id]
        verdicts = [Verdict.from_data(each) for each in result.verdicts]
        assert [verdict.kind for verdict in verdicts] == ["no_contact", "speed"]
        assert result.metrics["expectations.speed <= 1.2 m/s"] == verdicts[1].margin
        assert result.metrics["expectations.passed"] == float(result.is_passed)
    outcomes = {result.is_passed for result in plan.results.values()}
    assert outcomes == {True, False}  # the stronger wind pushes


def test_environments_and_single_runs_give_the_same_verdicts(tmp_path):
    together = flown({**STUDY, "vectorized": True}, tmp_path / "together")
    alone = flown({**STUDY, "vectorized": False, "sensors": "all"}, tmp_path / "alone")
    assert [together.results[run.id].verdicts for run in together.wanted()] == [
        alone.results[run.id].verdicts for run in alone.wanted()
    ]


def test_expectations_of_topics_need_simulations_of_their_own(tmp_path):
    expect = [{"kind": "topic_rate", "topic": "imu", "at_least_hz": 90.0}]
    study = {**STUDY, "changes": {"expect": expect}}
    with pytest.raises(StudyError, match="an expectation needs a simulation of its own"):
        flown({**study, "vectorized": True}, tmp_path / "out")
    plan = flown(study, tmp_path / "out")
    assert all(result.is_passed for result in plan.results.values())


def test_a_parameter_may_change_an_expectation(tmp_path):
    parameters = {"limit": {"key": "expect[1].at_most_m_s", "values": [0.001, 100.0]}}
    plan = flown({**STUDY, "parameters": parameters, "repetitions": 1}, tmp_path / "out")
    assert [plan.results[run.id].is_passed for run in plan.wanted()] == [False, True]


def test_a_scenario_that_expects_nothing_fails_its_runs(tmp_path):
    plan = flown({**STUDY, "changes": {"expect": []}}, tmp_path / "out")
    assert all("has no [[expect]]" in result.error for result in plan.results.values())


def test_a_parameter_named_seed_replaces_the_seeds(tmp_path):
    parameters = {
        "seed": {"key": "seed", "values": [5, 9]},
        "gusts": {"key": "world.wind.turbulence", "values": ["light", "moderate"]},
    }
    study = {**STUDY, "parameters": parameters, "combine": "list", "repetitions": 1}
    plan = flown(study, tmp_path / "out")
    assert [run.seed for run in plan.wanted()] == [5, 9]
    assert [plan.results[run.id].seed for run in plan.wanted()] == [5, 9]
