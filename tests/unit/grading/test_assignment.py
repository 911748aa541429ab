"""Assignments: what they say, and what is wrong with a bad one."""

from __future__ import annotations

import pytest
from assignments import ASSIGNMENT, SCENARIO, write_assignment

from volery.core.errors import VoleryError
from volery.grading import load_assignment


def test_an_assignment_names_points_and_seeds(tmp_path):
    text = 'scenario = "task.toml"\nseeds = 3\nfirst_seed = 40\n[points]\narrives = 2.5\n'
    assignment = load_assignment(write_assignment(tmp_path, text))
    assert list(assignment.seeds) == [40, 41, 42]
    assert assignment.points == {"no contact": 1.0, "arrives": 2.5}
    assert (assignment.name, assignment.scenario.name) == ("assignment", "task")


def test_a_shipped_scenario_with_expectations_will_do(tmp_path):
    file = tmp_path / "swarm.toml"
    file.write_text('scenario = "flock"\n', encoding="utf-8")
    assert load_assignment(file).points


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (ASSIGNMENT + "arrive = 1\n", "no expectation 'arrive'.*did you mean 'arrives'"),
        ('uav = "uav3"\n' + ASSIGNMENT, "no 'uav3' among 2"),
        ('uav = "bird"\n' + ASSIGNMENT, "uav"),
        ("seeds = 0\n" + ASSIGNMENT.replace("seeds = 1", ""), "seeds"),
        (ASSIGNMENT.replace("task.toml", "other.toml"), "other.toml: no such file"),
        ("time_s = 3\n" + ASSIGNMENT, "time_s"),
        ('node = "1st"\n' + ASSIGNMENT, "node"),
    ],
)
def test_a_bad_assignment_is_one_error(tmp_path, text, reason):
    with pytest.raises(VoleryError, match=reason):
        load_assignment(write_assignment(tmp_path, text))


def test_a_scenario_must_expect_something(tmp_path):
    scenario = SCENARIO.partition("[[expect]]")[0]
    with pytest.raises(VoleryError, match="expects nothing"):
        load_assignment(write_assignment(tmp_path, "scenario = 'task.toml'", scenario))
