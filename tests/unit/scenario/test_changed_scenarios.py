"""`Scenario.with_`: other values of its keys, checked as a file is."""

import pytest

from volery.core.errors import ScenarioError
from volery.scenario.load import load_scenario
from volery.scenario.wind import Wind


def test_only_what_is_named_changes_and_the_access_stays():
    scenario = load_scenario("forest_survey")
    changed = scenario.with_(seed=7, world={"seed": 1, "wind": {"turbulence": "light"}})
    assert (changed.seed, changed.world.seed, changed.world.wind.turbulence) == (7, 1, "light")
    assert changed.world.wind.velocity_m_s == scenario.world.wind.velocity_m_s
    assert changed.world.forest == scenario.world.forest
    assert changed.types == scenario.types
    assert changed.access is scenario.access
    assert scenario.seed == 1
    assert scenario.with_() == scenario


def test_lists_models_and_tables_of_another_kind_replace():
    scenario = load_scenario("forest_survey")
    group = {"type": scenario.uavs[0].type, "position_m": [1.0, 2.0]}
    forest = {"kind": "procedural", "region_m": [0, 0, 9, 9], "trees": 3, "species": {"palm": 1}}
    wind = Wind(velocity_m_s=(1.0, 0.0, 0.0))
    changed = scenario.with_(uavs=[group], world={"forest": forest, "wind": wind})
    assert [each.position_m for each in changed.uavs] == [(1.0, 2.0)]
    assert changed.world.forest.trees == 3
    assert changed.world.wind == wind


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sed": 7}, r"^hover: with_\(\): unknown key 'sed'; did you mean 'seed'\?"),
        ({"seed": -1}, r"^hover: with_\(\): key 'seed': .* \(found -1\)$"),
        ({"world": {"wind": {"turbulence": "mild"}}}, r"key 'world\.wind\.turbulence': .*'light'"),
        ({"world": {"forest": {}}}, r"key 'world\.forest'"),
    ],
)
def test_wrong_changes_are_refused_with_the_key(changes, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("hover").with_(**changes)
