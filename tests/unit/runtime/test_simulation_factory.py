"""`volery.make`: a simulation from a name and changes."""

import pytest

import volery


def test_a_name_and_changes():
    with volery.make("hover", {"types.*.flight.take_off_altitude_m": 1.5}, uavs=2, seed=5) as run:
        assert (run.scenario.seed, list(run.uavs)) == (5, ["uav1", "uav2"])
        run.run(3.0)
        assert run.uavs["uav2"].position_map[2] == pytest.approx(1.5, abs=0.3)


def test_a_scenario_as_it_is(flat_data, tmp_path):
    scenario = volery.load_scenario("hover")
    with volery.make(scenario, threads=1) as run:
        assert run.scenario is scenario
    path = tmp_path / "own.toml"
    scenario.with_(name="own").save(path)
    with volery.make(path) as run:
        assert run.scenario.name == "own"
        assert not run.scenario.access.is_trusted
    with volery.make(path, trust=True) as run:
        assert run.scenario.access.is_trusted


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("hoover", {}, "no scenario 'hoover'; did you mean 'hover'"),
        ("hover", {"sed": 1}, "unknown key 'sed'; did you mean 'seed'"),
        ({"name": "own"}, {}, "a scenario is .*, not dict; parse_scenario makes one"),
        (None, {}, "a scenario is .*, not NoneType"),
        ("hover", {"threads": 0}, "threads must be at least 1"),
    ],
)
def test_errors_name_the_remedy(name, changes, message):
    with pytest.raises(volery.ScenarioError, match=message):
        volery.make(name, **changes)
