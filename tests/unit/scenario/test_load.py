"""Bad scenarios get one clear message: file, key, what is allowed."""

import copy

import pytest

from volery.core.errors import ScenarioError
from volery.scenario import library
from volery.scenario.data_file_bases import read_toml
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.overrides import apply

GOOD = {
    "name": "test",
    "types": {"t": {"sensors": [{"kind": "lidar", "name": "front"}]}},
    "uavs": [{"type": "t", "position_m": [0, 0], "last_position_m": [9, 0]}],
}


def broken(path, value):
    data = copy.deepcopy(GOOD)
    target = data
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    return data


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (broken(["sed"], 3), ["unknown key 'sed'", "did you mean 'seed'", "duration_s"]),
        (
            broken(["types", "t", "sensors", 0, "nois"], True),
            ["types.t.sensors[0].nois", "did you mean 'noise'", "nodding"],
        ),
        (
            broken(["world"], {"terrain": {"kind": "flat", "heigth_m": 1}}),
            ["world.terrain.heigth_m", "did you mean 'height_m'"],
        ),
        (broken(["uavs", 0, "position_m"], [float("nan"), 0]), ["position_m[0]", "finite"]),
        (broken(["uavs"], []), ["key 'uavs'", "at least 1"]),
        (broken(["uavs", 0, "count"], 0), ["uavs[0].count", "a number of at least 1"]),
        (broken(["uavs", 0, "type"], "x"), ["uavs[0].type 'x'", "known: t"]),
        (broken(["duration_s"], -1), ["duration_s", "a number above 0", "-1"]),
        (broken(["duration_s"], float("inf")), ["duration_s", "finite"]),
        (broken(["seed"], "one"), ["seed", "a whole number", "'one'"]),
        (broken(["types", "t", "sensors", 0, "kind"], "radar"), ["radar", "lidar", "imu"]),
        (
            broken(["types", "t", "sensors", 0, "kind"], "gps"),
            ["sensors[0].kind': no 'gps'; did you mean 'gnss'? Allowed: lidar, "],
        ),
        (broken(["types", "t", "sensors", 0], {}), ["key 'types.t.sensors[0].kind' is missing"]),
        (
            broken(["types", "t", "sensors"], [{"kind": "lidar"}, {"kind": "lidar"}]),
            ["sensor names must differ", "horizontal"],
        ),
        (broken(["physics"], {"rate_hz": 300}), ["rate_hz", "divide"]),
        (
            broken(["world"], {"wind": {"velocity_m_s": [100, 0, 0]}}),
            ["world.wind", "60"],
        ),
        (
            broken(["uavs"], [{"type": "t", "position_m": [0, 0], "count": 2}]),
            ["uavs[0]", "last_position_m is needed"],
        ),
        ({"name": "a"}, ["types", "uavs", "missing"]),
        (
            broken(["uavs"], {"type": "t", "position_m": [0, 0]}),
            ["my.toml: key 'uavs'", "write [[uavs]], not [uavs]"],
        ),
        (
            broken(["types", "t", "sensors"], {"kind": "imu"}),
            ["key 'types.t.sensors'", "write [[types.t.sensors]], not [types.t.sensors]"],
        ),
        (
            broken(["types", "t", "nodes"], {"node": "a:B"}),
            ["key 'types.t.nodes'", "write [[types.t.nodes]], not [types.t.nodes]"],
        ),
        (
            broken(["uavs", 0, "position_m"], {"x": 1}),
            ["key 'uavs[0].position_m'", "a list is needed"],
        ),
        (
            broken(["types", "t", "sensors"], [{"kind": "imu", "name": "cmd_vel"}]),
            ["types.t", "'cmd_vel' is no name", "joint_states"],
        ),
        (
            broken(["types", "t", "sensors"], [{"kind": "odometry", "name": "vio"}]),
            ["types.t.sensors[0].name", "'odom'"],
        ),
        (
            broken(
                ["world"],
                {
                    "forest": {
                        "kind": "inventory",
                        "file": "a",
                        "species": "b",
                        "region_m": [5, 0, 0, 5],
                    }
                },
            ),
            ["key 'world.forest'", "region_m must be"],
        ),
    ],
)
def test_one_clear_message(data, words):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(data, where="my.toml")
    text = str(caught.value)
    assert text.startswith("my.toml")
    for word in words:
        assert word in text, text
    assert "tuple[" not in text


def test_good_data_is_taken():
    scenario = parse_scenario(GOOD)
    assert scenario.uav_count == 1
    assert scenario.types["t"].sensors[0].name == "front"


def test_files_with_a_byte_order_mark(tmp_path):
    (tmp_path / "base.toml").write_text('base = "f450"\nname = "mine"\n', encoding="utf-8-sig")
    assert read_toml(tmp_path / "base.toml")["name"] == "mine"
    file = tmp_path / "bom.toml"
    file.write_text(
        'name = "bom"\n[types.t]\n[[uavs]]\ntype = "t"\nposition_m = [0, 0]\n', encoding="utf-8-sig"
    )
    assert load_scenario(file).name == "bom"


def test_unknown_name_lists_the_library_and_guesses():
    with pytest.raises(ScenarioError, match=r"did you mean 'hover'.*forest_survey"):
        load_scenario("hoover")


def test_missing_file_folder_and_bad_toml(tmp_path):
    with pytest.raises(ScenarioError, match="no such file"):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(ScenarioError, match="is a folder"):
        load_scenario(tmp_path)
    bad = tmp_path / "bad.toml"
    bad.write_text("name = ")
    with pytest.raises(ScenarioError, match=r"bad\.toml: not valid TOML"):
        load_scenario(bad)
    bad.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_scenario(bad)


@pytest.mark.parametrize("name", library.names())
def test_library_scenarios_load_and_describe_themselves(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert library.describe(name) == scenario.description


def test_overrides():
    scenario = apply(parse_scenario(GOOD), uavs=5, seconds=3.0, seed=9)
    assert (scenario.uav_count, scenario.duration_s, scenario.seed) == (5, 3.0, 9)
    with pytest.raises(ScenarioError, match="at least 1 UAV"):
        apply(scenario, uavs=0)
    with pytest.raises(ScenarioError, match="--seconds: a run lasts"):
        apply(scenario, seconds=-1.0)
    two = copy.deepcopy(GOOD)
    two["uavs"] = two["uavs"] * 2
    with pytest.raises(ScenarioError, match="2 groups"):
        apply(parse_scenario(two), uavs=3)


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_files_in_another_encoding_say_what_to_do(tmp_path, encoding):
    """PowerShell writes UTF-16."""
    (tmp_path / "other.toml").write_text('name = "grün"\n', encoding=encoding)
    with pytest.raises(
        ScenarioError, match=r"not UTF-8 text \(byte 0x.. at \d+\): save it as UTF-8"
    ):
        load_scenario(tmp_path / "other.toml")
