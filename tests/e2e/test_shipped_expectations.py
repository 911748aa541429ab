"""Shipped scenarios do what their expectations say."""

from __future__ import annotations

import pytest

from volery.scenario.load import list_scenarios, load_scenario
from volery.verdicts import judged_flight

EXPECTING = [name for name in list_scenarios() if load_scenario(name).expect]
SEEN = ("obstacle_field", "servoing")
"""Scenarios with cameras, whose flights take longest."""


def test_some_have_expectations():
    assert {"flock", "policy_homing", *SEEN} <= {*EXPECTING}


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in SEEN else ()) for n in EXPECTING],
)
def test_a_flight_passes(name):
    judged = judged_flight(load_scenario(name))
    assert [v.describe() for v in judged.verdicts if not v.is_passed] == []
