"""The profiles that ship start the nodes of forest_search with its parameters, those measured."""

from pathlib import Path
from typing import Any

import pytest

from volery.bridges.nodes.profile import load_profile
from volery.scenario.load import load_scenario

PROFILES = Path(__file__).parents[3] / "examples/profiles"
RADIO = "radio"
DIFFERENT: dict[tuple[str, str], dict[str, Any]] = {
    # Without a known position of take-off it is measured.
    (name, "slam"): {"initial_pose": [24.0, 260.0, 144.2, 0.0]}
    for name in ("simulation", "ground_test", "flight_test")
} | {("flight_test", "local_planner"): {"speed_m_s": 1.5}}
"""What a profile says otherwise on purpose, by profile and node."""


@pytest.mark.parametrize("name", ["simulation", "ground_test", "flight_test"])
def test_profiles_fly_as_the_scenario_does(name: str) -> None:
    (kind,) = load_scenario("forest_search").types.values()
    profile = load_profile(PROFILES / f"{name}.toml")
    assert not profile.parameters
    launched = {entry.node: dict(entry.parameters) for entry in profile.launch}
    radio = launched.pop(RADIO, None)
    assert (radio is None) == (name == "simulation")  # there the radio is the run's
    for entry in kind.nodes:
        expected = dict(entry.parameters)
        for key, value in DIFFERENT.get((name, entry.node), {}).items():
            assert expected[key] != value
            expected[key] = value
        assert launched.pop(entry.node) == expected, entry.node
    assert not launched
