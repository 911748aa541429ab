"""Maps of failures: the part of the flight that they show."""

from __future__ import annotations

import numpy as np
import pytest
from made_runs import flight_of, line, run_of

from volery.verdicts import failure_map
from volery.verdicts.judging import Judge

EAST = line([0.0, 0.0, 3.0], [10.0, 0.0, 3.0], 101)


@pytest.fixture
def drawn(monkeypatch):
    """Draws the failure of an expectation and returns the axes."""
    from matplotlib.figure import Figure

    figures = []
    save = Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda self, *a, **k: (figures.append(self), save(self, *a, **k))
    )

    def draw(flight, *expectations):
        run = run_of(flight, *expectations)
        verdicts = Judge(run.scenario).verdicts(run)
        image = failure_map.failure_png(flight, verdicts, run.scenario.expect)
        assert image.startswith(b"\x89PNG")
        return figures[-1].axes[0]

    return draw


def test_the_view_is_around_the_first_failure(drawn):
    axes = drawn(flight_of([EAST]), {"kind": "inside", "region_m": [-1.0, -1.0, 6.0, 1.0]})
    assert axes.get_xlim() == pytest.approx((10.0 - 15.0, 10.0 + 15.0))
    assert "outside" in axes.get_title()
    labels = axes.get_legend_handles_labels()[1]
    assert any(label.startswith("its horizontal velocity (1.0 m/s)") for label in labels)
    assert "start" in labels


def test_a_goal_that_is_missed_is_in_view(drawn):
    goal = {"kind": "arrives", "position_m": [60.0, 40.0]}
    axes = drawn(flight_of([EAST]), {"kind": "no_contact"}, goal)
    (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert low < 10.0 < 60.0 < high
    assert bottom < 0.0 < 40.0 < top
    assert "expected arrival" in axes.get_legend_handles_labels()[1]


def test_a_failure_without_a_moment_shows_the_flight(drawn):
    late = EAST.copy()
    late[:10] = np.nan
    axes = drawn(flight_of([late]), {"kind": "area", "at_least_m2": 1e5})
    assert axes.get_title() == ""
