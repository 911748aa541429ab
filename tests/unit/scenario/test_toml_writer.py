"""Scenarios as TOML: what is written loads again, to the same."""

import datetime
import math
import tomllib

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from volery.core.errors import ScenarioError
from volery.scenario import Daylight, NodeEntry, World, list_scenarios, load_scenario
from volery.scenario.load import parse_scenario
from volery.scenario.toml_writer import toml_text

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
NUMBERS = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False)
VALUES = st.recursive(
    st.booleans() | NUMBERS | TEXTS | st.dates(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=25,
)


@given(st.dictionaries(TEXTS, VALUES, max_size=5))
@example({"list": [{"outer": {"inner": {}}}]})
@example({"list": [{"a": [], "b": {"c": {}}}]})
def test_plain_data_loads_again(data):
    assert tomllib.loads(toml_text(data)) == data


def test_nan_is_written():
    assert math.isnan(tomllib.loads(toml_text({"x": math.nan}))["x"])


@pytest.mark.parametrize("name", list_scenarios())
def test_shipped_scenarios_load_again(name, tmp_path):
    scenario = load_scenario(name)
    read = parse_scenario(tomllib.loads(scenario.to_toml()))
    assert read == scenario
    assert read.data() == scenario.data()
    path = tmp_path / "again.toml"
    scenario.save(path)
    assert load_scenario(path) == scenario


def test_the_text_reads_like_a_shipped_file(flat_data):
    flat_data["world"] = {"wind": {"velocity_m_s": [1.0, 0.0, 0.0]}}
    flat_data["types"]["f450"]["sensors"] = [
        {"name": "nodding", "nodding": {"period_s": 1.0}, "kind": "lidar"},
    ]
    assert parse_scenario(flat_data).to_toml() == (
        'name = "flat"\n\n'
        "[world.wind]\nvelocity_m_s = [1.0, 0.0, 0.0]\n\n"
        '[[types.f450.sensors]]\nkind = "lidar"\nname = "nodding"\nnodding = { period_s = 1.0 }\n\n'
        '[[uavs]]\ntype = "f450"\nposition_m = [0.0, 0.0]\nlast_position_m = [20.0, 0.0]\n'
    )


def test_dates_and_absent_values(flat_data):
    light = Daylight(hour_of_day=8.0, date=datetime.date(2024, 2, 29))
    scenario = parse_scenario({**flat_data, "world": World(light=light, forest=None)})
    text = scenario.to_toml()
    assert "date = 2024-02-29" in text
    assert "forest" not in text
    assert parse_scenario(tomllib.loads(text)) == scenario


@pytest.mark.parametrize("value", [None, {1, 2}, object(), [None]])
def test_what_toml_lacks_is_refused_with_the_key(flat_data, value):
    node = NodeEntry(node="slam", parameters={"odd": value})
    scenario = parse_scenario({**flat_data, "nodes": [node]})
    with pytest.raises(ScenarioError, match=r"^key 'nodes\.parameters\.odd.*TOML has no \w+; use"):
        scenario.to_toml()


def test_lone_surrogates_are_refused():
    with pytest.raises(ScenarioError, match="key 'x': the text is not valid Unicode"):
        toml_text({"x": "\ud800"})


# ------------------------------------------------------------------------------------------ files


def test_files_of_the_old_folder_are_found_from_the_new_one(flat_data, tmp_path):
    old, new = tmp_path / "old", tmp_path / "new"
    old.mkdir()
    new.mkdir()
    (old / "trees.csv").write_text("x_m,y_m\n1,2\n")
    forest = {"kind": "inventory", "file": "trees.csv", "species": "conifer"}
    parse_scenario({**flat_data, "world": {"forest": forest}}).save(old / "a.toml")
    scenario = load_scenario(old / "a.toml")
    scenario.save(new / "b.toml")
    saved = load_scenario(new / "b.toml")
    assert saved.world.forest.file == "../old/trees.csv"
    assert saved.access.find_file(saved.world.forest.file).read_text().startswith("x_m")
    assert saved.types["f450"].airframe == "f450"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.json", r"a scenario is a \.toml file"),
        ("none/a.toml", "cannot be written: No such file"),
    ],
)
def test_bad_paths_are_refused(tmp_path, name, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("hover").save(tmp_path / name)
