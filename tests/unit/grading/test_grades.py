"""Points, and the table and page of grades."""

from __future__ import annotations

import csv
import io
import json

import pytest
from assignments import write_assignment

from volery.cli.grade import csv_of, html_of
from volery.grading import Grade, GradedFlight, load_assignment
from volery.verdicts import Outcome
from volery.verdicts.verdict import Verdict

POINTS = {"no contact": 1.0, "arrives": 3.0}


def flight(seed, *, contact=True, arrives=True, problem="", name="ann"):
    outcomes = {"no contact": contact, "arrives": arrives}
    verdicts = tuple(
        Verdict(what, "kind", Outcome.PASSED if passed else Outcome.FAILED, "1 m")
        for what, passed in outcomes.items()
    )
    return GradedFlight(name, seed, () if problem else verdicts, "ab" * 32, problem)


def test_points_are_the_fraction_of_flights_that_pass():
    grade = Grade("ann", (flight(1), flight(2, arrives=False), flight(3, arrives=False)), POINTS)
    assert grade.points == {"no contact": 1.0, "arrives": pytest.approx(1.0)}
    assert grade.total == pytest.approx(2.0)
    assert grade.problems == []


def test_a_flight_that_did_not_take_place_has_no_points():
    late = "the node took more than 60 s"
    grade = Grade("ann", (flight(1), *(flight(k, problem=late) for k in (2, 3))), POINTS)
    assert grade.total == pytest.approx(4.0 / 3.0)
    assert grade.problems == [f"seed 2: {late}"]
    assert json.loads(json.dumps(grade.to_data()))["points"]["arrives"] == pytest.approx(1.0)


@pytest.fixture
def graded(tmp_path):
    """Returns an assignment and grades with names that attack a spreadsheet and a page."""
    assignment = load_assignment(write_assignment(tmp_path))
    names = ("ann", "=cmd()", "<script>x</script>")
    grades = [Grade(name, (flight(1, name=name, problem="a <b>"),), POINTS) for name in names]
    return assignment, grades


def test_the_table_has_a_row_each_and_no_formulas(graded):
    rows = list(csv.reader(io.StringIO(csv_of(*graded))))
    assert rows[0] == ["submission", "points", "of", "no contact", "arrives", "problems"]
    assert [row[0] for row in rows[1:]] == ["ann", "'=cmd()", "<script>x</script>"]
    assert rows[1][1:3] == ["0", "4"]


def test_the_page_escapes_names_and_problems(graded):
    page = html_of(*graded)
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "a &lt;b&gt;" in page
