"""What a client may change of a scenario that it loads: JSON, errors, what comes of it."""

import copy

import pytest

from volery.core.errors import ScenarioError
from volery.scenario.changes import Changes, apply, parse_changes
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.sensor_sets import SENSOR_SETS, describe, sets_of


def kinds(scenario, name):
    return [sensor.kind for sensor in scenario.types[name].sensors]


def test_nothing_changes_nothing():
    scenario = load_scenario("longleaf")
    assert parse_changes("") == parse_changes(" {} ") == Changes()
    assert apply(scenario, Changes()) == scenario
    assert apply(scenario, Changes()).access == scenario.access


def test_numbers():
    text = '{"uavs": 5, "seed": 3, "seconds": 12.5, "speed": 0, "sensors": []}'
    changes = parse_changes(text)
    assert (changes.uavs, changes.seed, changes.seconds, changes.speed) == (5, 3, 12.5, 0.0)
    assert changes.sensors == ()
    scenario = apply(load_scenario("longleaf"), changes)
    assert (scenario.uav_count, scenario.seed, scenario.duration_s) == (5, 3, 12.5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", ["not JSON"]),
        ("[1]", ["JSON object"]),
        ('{"uav": 5}', ["unknown key 'uav'", "did you mean 'uavs'"]),
        ('{"uavs": 0}', ["key 'uavs'", "a number of at least 1", "found 0"]),
        ('{"uavs": "many"}', ["key 'uavs'", "many"]),
        ('{"sensors": ["radar"]}', ["key 'sensors[0]'", "'lidar'", "found 'radar'"]),
        ('{"speed": NaN}', ["speed"]),
        ('{"tree_share": 1.5}', ["key 'tree_share'", "a number of at most 1"]),
        ('{"seconds": -1}', ["key 'seconds'"]),
    ],
)
def test_what_is_wrong_is_named(text, words):
    with pytest.raises(ScenarioError) as caught:
        parse_changes(text)
    assert str(caught.value).startswith("changes")
    assert all(word in str(caught.value) for word in words), caught.value


# ------------------------------------------------------------------------------------------- UAVs


def test_more_uavs_find_room_on_the_old_line():
    scenario = apply(load_scenario("hover"), Changes(uavs=50))
    (group,) = scenario.uavs
    assert (group.count, group.placement) == (50, "nearest_free")
    assert group.last_position_m == (20.0, 0.0)
    fewer = apply(load_scenario("coverage"), Changes(uavs=2))
    assert (fewer.uavs[0].count, fewer.uavs[0].placement) == (2, "nearest_free")


def test_a_scenario_of_one_gets_a_line():
    scenario = apply(load_scenario("forest_cameras"), Changes(uavs=3))
    assert scenario.uavs[0].last_position_m == (15.0, 56.0)


def test_a_line_in_the_air_is_long_enough(flat_data):
    flat_data["uavs"] = [{"type": "f450", "position_m": [1.0, 2.0, 5.0]}]
    scenario = apply(parse_scenario(flat_data), Changes(uavs=4))
    (group,) = scenario.uavs
    assert (group.last_position_m, group.placement) == ((1.0, 11.0), "exact")


def test_several_groups_say_themselves_how_many_fly():
    scenario = load_scenario("swarm_100")
    assert apply(scenario, Changes(uavs=100)) == scenario
    with pytest.raises(ScenarioError, match="10 groups of UAVs, 100 in all"):
        apply(scenario, Changes(uavs=7))


def test_another_airframe_for_all(flat_data):
    worn = [{"thrust": 0.9}] * 4
    flat_data["types"]["other"] = {"airframe": "iris", "wear": worn}
    scenario = apply(parse_scenario(flat_data), Changes(airframe="iris"))
    assert [kind.airframe for kind in scenario.types.values()] == ["iris", "iris"]
    assert len(scenario.types["other"].wear) == 4  # it was one already
    scenario = apply(parse_scenario(flat_data), Changes(airframe="crazyflie"))
    assert scenario.types["other"].wear == ()


# ---------------------------------------------------------------------------------------- sensors


def test_every_set_can_be_added_and_taken_away(flat_data):
    bare = copy.deepcopy(flat_data)
    bare["types"]["f450"]["sensors"] = [{"kind": "imu"}, {"kind": "ground_truth"}]
    for name in SENSOR_SETS:
        assert describe(name)
        fitted = apply(parse_scenario(bare), Changes(sensors=(name,)))
        assert sets_of(fitted.types["f450"]) == (name,)
        assert kinds(fitted, "f450")[:2] == ["imu", "ground_truth"]
        assert kinds(apply(fitted, Changes(sensors=())), "f450") == ["imu", "ground_truth"]
    everything = apply(parse_scenario(bare), Changes(sensors=SENSOR_SETS))
    assert sets_of(everything.types["f450"]) == SENSOR_SETS
    assert kinds(everything, "f450").count("lidar") == 2


def test_what_a_scenario_has_of_a_set_it_keeps():
    scenario = load_scenario("forest_cameras")
    assert sets_of(scenario.types["seer"]) == ("lidar", "camera", "sonar")
    kept = apply(scenario, Changes(sensors=("camera",)))
    cameras = [s for s in scenario.types["seer"].sensors if s.kind == "camera"]
    assert [s for s in kept.types["seer"].sensors if s.kind == "camera"] == cameras
    assert kinds(kept, "seer") == ["camera"] * len(cameras) + ["imu", "odometry", "ground_truth"]


def test_an_estimator_keeps_what_it_lives_on(flat_data):
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "imu"},
        {"kind": "gnss"},
        {"kind": "estimate"},
    ]
    scenario = apply(parse_scenario(flat_data), Changes(sensors=("sonar",)))
    assert kinds(scenario, "f450") == ["imu", "gnss", "estimate", "sonar"]


# ------------------------------------------------------------------------------------------ trees


def test_the_density_of_a_procedural_forest(wood_data):
    scenario = apply(parse_scenario(wood_data), Changes(tree_density_per_ha=80.0))
    assert scenario.world.forest.trees == 80  # on one hectare
    with pytest.raises(ScenarioError, match="use 'tree_density_per_ha'"):
        apply(parse_scenario(wood_data), Changes(tree_share=0.5))
    with pytest.raises(ScenarioError, match="trees"):
        apply(parse_scenario(wood_data), Changes(tree_density_per_ha=1e7))


def test_a_fraction_of_an_inventory():
    scenario = load_scenario("longleaf")
    assert apply(scenario, Changes(tree_share=0.25)).world.forest.fraction == 0.25
    with pytest.raises(ScenarioError, match="use 'tree_share'"):
        apply(scenario, Changes(tree_density_per_ha=100.0))
    with pytest.raises(ScenarioError, match=r"has no procedural forest$"):
        apply(load_scenario("hover"), Changes(tree_density_per_ha=100.0))
