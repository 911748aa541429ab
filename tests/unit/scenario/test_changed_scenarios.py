"""`Scenario.with_`: other values of its keys, checked as a file is."""

import numpy as np
import pytest

from volery.core.errors import ScenarioError
from volery.scenario.load import load_scenario
from volery.scenario.schema import SonarSensor
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
        ({"sed": 7}, r"^hover: unknown key 'sed'; did you mean 'seed'\?"),
        ({"seed": -1}, r"^hover: key 'seed': .* \(found -1\)$"),
        ({"world": {"wind": {"turbulence": "mild"}}}, r"key 'world\.wind\.turbulence': .*'light'"),
        ({"world": {"forest": {}}}, r"key 'world\.forest\.kind' is missing"),
    ],
)
def test_wrong_changes_are_refused_with_the_key(changes, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("hover").with_(**changes)


# ---------------------------------------------------------------------------------- paths of keys


def test_paths_reach_tables_lists_and_all_tables():
    scenario = load_scenario("city_flight")
    changed = scenario.with_(
        {
            "world.wind.turbulence": "light",
            "world.light": {"hour_of_day": 9.0},
            "uavs[1].yaw_deg": 90.0,
            "types.*.battery_charge": 0.5,
            "types.surveyor.sensors[1].nodding": {"period_s": 2.0},
        },
        seed=4,
    )
    assert changed.seed == 4
    assert changed.world.wind.turbulence == "light"
    assert changed.world.wind.velocity_m_s == scenario.world.wind.velocity_m_s
    assert changed.world.light.hour_of_day == 9.0
    assert [group.yaw_deg for group in changed.uavs] == [0.0, 90.0, 0.0]
    surveyor = changed.types["surveyor"]
    assert surveyor.battery_charge == 0.5
    assert (surveyor.sensors[1].nodding.period_s, surveyor.sensors[1].nodding.amplitude_deg) == (
        2.0,
        45.0,
    )
    assert scenario.uavs[1].yaw_deg == 0.0


def test_paths_go_on_into_models():
    wind = Wind(velocity_m_s=(1.0, 0.0, 0.0))
    changed = load_scenario("hover").with_({"world.wind": wind, "world.wind.turbulence": "light"})
    assert (changed.world.wind.velocity_m_s, changed.world.wind.turbulence) == (
        (1.0, 0.0, 0.0),
        "light",
    )


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("world.wind.turbulenc", r"unknown key 'world\.wind\.turbulenc'; did you mean"),
        ("uavs[1].yaw_deg", r"key 'uavs\[1\]\.yaw_deg': there is no entry \[1\]; the list has 1"),
        ("faults[0].at_s", r"key 'faults\[0\]\.at_s': there is no entry \[0\]; the list has 0"),
        ("uavs.yaw_deg", r"'yaw_deg' is not inside a table; name an entry as \[0\]"),
        ("duration_s.x", r"'x' is not inside a table"),
        ("world..wind", r"'world\.\.wind' is no path of keys; write 'world\.wind\.turbulence'"),
        ("[0]", r"is no path of keys"),
    ],
)
def test_wrong_paths_are_refused(path, message):
    with pytest.raises(ScenarioError, match=r"^hover: .*" + message):
        load_scenario("hover").with_({path: 1})


def test_an_assignment_is_refused():
    with pytest.raises(ScenarioError, match=r"do not change; with_\(seed=\.\.\.\) returns a copy"):
        load_scenario("hover").seed = 3


def test_a_file_is_replaced_only_on_request(tmp_path):
    scenario = load_scenario("hover")
    scenario.save(tmp_path / "mine.toml")
    with pytest.raises(ScenarioError, match="the file exists; overwrite=True replaces it"):
        scenario.save(tmp_path / "mine.toml")
    scenario.with_(seed=3).save(tmp_path / "mine.toml", overwrite=True)
    assert load_scenario(tmp_path / "mine.toml").seed == 3


# ------------------------------------------------------------------------------------ short forms


def test_short_forms():
    changed = load_scenario("hover").with_(
        uavs=np.int64(4),
        wind=np.array([3.0, 0.0, 0.0]),
        weather={"rain_mm_h": 5.0},
        airframe="iris",
        sensors=["lidar", "camera"],
    )
    assert (changed.uav_count, changed.uavs[0].placement) == (4, "nearest_free")
    assert changed.world.wind.velocity_m_s == (3.0, 0.0, 0.0)
    assert changed.world.weather.rain_mm_h == 5.0
    assert changed.types["f450"].airframe == "iris"
    kinds = [sensor.kind for sensor in changed.types["f450"].sensors]
    assert kinds == ["imu", "odometry", "ground_truth", "lidar", "lidar", "camera"]


def test_wind_as_a_table_merges_and_as_a_model_replaces():
    scenario = load_scenario("city_flight")
    merged = scenario.with_(wind={"turbulence": "light"}).world.wind
    assert (merged.turbulence, merged.velocity_m_s) == ("light", (2.0, 1.0, 0.0))
    assert scenario.with_(wind=Wind()).world.wind == Wind()


def test_sensors_as_models_and_tables_replace_all():
    changed = load_scenario("longleaf").with_(sensors=[{"kind": "imu"}, SonarSensor(rate_hz=20.0)])
    assert [sensor.kind for sensor in changed.types["surveyor"].sensors] == ["imu", "sonar"]
    assert load_scenario("hover").with_(sensors=[]).types["f450"].sensors == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"uavs": 0}, r"key 'uavs\[0\]\.count': .*a number of at least 1"),
        ({"uavs": 2.5}, r"key 'uavs': give a whole number or a list of groups \(found 2\.5\)"),
        ({"uavs": True}, r"key 'uavs': give a whole number .*found True"),
        ({"winds": 3}, r"unknown key 'winds'; did you mean 'wind'\? Allowed here: airframe, "),
        ({"wind.turbulence": "light"}, r"'wind\.turbulence'; write 'world\.wind\.turbulence'"),
        ({3: "x"}, r"a key is a text such as 'world\.wind' \(found 3\)"),
        ({"sensors": None}, r"key 'sensors': give sets \(lidar, .* \(found None\)"),
        ({"wind": 3.0}, r"key 'world\.wind\.velocity_m_s': a list is needed"),
        ({"airframe": 7}, r"key 'types\.f450\.airframe': a text is needed"),
        ({"sensors": "radar"}, r"key 'sensors': no set 'radar'; give sets \(lidar, camera"),
        ({"sensors": ["lidar", SonarSensor()]}, r"names of sets and sensors are mixed; give"),
        ({"weather": {"rain": 1}}, r"unknown key 'world\.weather\.rain'"),
    ],
)
def test_wrong_short_forms_are_refused(changes, message):
    with pytest.raises(ScenarioError, match=r"^hover: .*" + message):
        load_scenario("hover").with_(changes)


def test_groups_are_not_resized():
    with pytest.raises(ScenarioError, match="10 groups of UAVs, 100 in all"):
        load_scenario("swarm_100").with_(uavs=7)
