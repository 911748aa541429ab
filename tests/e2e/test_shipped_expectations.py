"""Shipped scenarios do what their expectations say."""

from __future__ import annotations

import pytest

from volery.scenario.load import list_scenarios, load_scenario
from volery.verdicts import judged_flight

NOT_FLOWN_HERE = {
    "forest_survey": ".ci/fresh_clone flies it with --fail-on expectation",
    "forest_search": "takes four minutes: volery test forest_search",
}
LONG = {
    *("city_flight", "cooperative_search", "coverage", "forest_procedural", "forest_rain"),
    *("obstacle_field", "servoing"),
}
FLOWN = [name for name in list_scenarios() if name not in NOT_FLOWN_HERE]


@pytest.mark.parametrize("name", list_scenarios())
def test_all_have_expectations(name):
    assert load_scenario(name).expect


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in FLOWN]
)
def test_a_flight_passes(name):
    judged = judged_flight(load_scenario(name))
    assert [v.describe() for v in judged.verdicts if not v.is_passed] == []
