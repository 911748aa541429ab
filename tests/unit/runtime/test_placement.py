"""UAVs that cannot stand where the scenario puts them are refused with the reason."""

import numpy as np
import pytest

from volery.core import rotations
from volery.core.errors import DataFileError, PlacementError, ScenarioError
from volery.graph.messages import Imu
from volery.vehicle.airframe import load_airframe


def test_under_the_ground(simulate, flat_data):
    flat_data["uavs"] = [{"type": "f450", "position_m": [0.0, 0.0, -1.0]}]
    with pytest.raises(PlacementError, match=r"uavs\[0\] \(uav1\).*under the ground.*at least"):
        simulate(flat_data)


def test_inside_a_tree(simulate, wood_data):
    free = simulate(wood_data)
    x, y, _ = free.world.forest.position_map[0]
    wood_data["uavs"] = [{"type": "surveyor", "position_m": [float(x), float(y)]}]
    with pytest.raises(PlacementError, match=r"lies in tree \d+.*nearest_free"):
        simulate(wood_data)


def test_overlapping_each_other(simulate, flat_data):
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0]},
        {"type": "f450", "position_m": [0.3, 0.0]},
    ]
    with pytest.raises(PlacementError, match=r"uavs\[1\] \(uav2\).*overlaps uav1"):
        simulate(flat_data)


def test_nearest_free_finds_room_to_stand_and_climb(simulate, wood_data):
    simulation = simulate(wood_data)
    for uav in simulation.uavs.values():
        column = uav.position_map + np.array([[0, 0, 0], [0, 0, 1], [0, 0, 2]])
        room = simulation.world.scene.clearance(column, 1.5, include_terrain=False)
        assert room.distance.min() >= 1.4


def test_a_line_of_uavs_is_evenly_spaced(simulate, flat_data):
    flat_data["uavs"][0]["count"] = 5
    simulation = simulate(flat_data)
    xs = [uav.position_map[0] for uav in simulation.uavs.values()]
    np.testing.assert_allclose(xs, [0, 5, 10, 15, 20])
    assert simulation.vehicles.names == ("uav1", "uav2", "uav3", "uav4", "uav5")


@pytest.mark.parametrize("slope", [0.0, 0.3])
@pytest.mark.parametrize("airframe", ["f450", "crazyflie"])
def test_a_standing_uav_rests_from_the_first_step(simulate, flat_data, tmp_path, slope, airframe):
    """Its IMU measures gravity alone, its pose does not change, and it stands on its feet."""
    rows = [",".join(f"{slope * (x + 0.5 * y):.6f}" for x in range(5)) for y in range(5)]
    (tmp_path / "slope.csv").write_text("\n".join(rows) + "\n")
    ground = {"kind": "grid", "file": str(tmp_path / "slope.csv"), "spacing_m": 1.0}
    flat_data["world"] = {"terrain": ground}
    flat_data["types"] = {
        "still": {
            "airframe": airframe,
            "sensors": [{"kind": "imu", "noise": False, "rate_hz": 1000}],
        }
    }
    flat_data["uavs"] = [{"type": "still", "position_m": [2.2, 1.7], "yaw_deg": 30.0}]
    simulation = simulate(flat_data)
    uav, felt = simulation.uavs["uav1"], []
    start, attitude = uav.position_map.copy(), uav.attitude.copy()
    simulation.graph.subscribe(
        "/uav1/imu",
        lambda p: felt.append([getattr(p.message.linear_acceleration, axis) for axis in "xyz"]),
        Imu,
    )
    simulation.run(0.3)
    assert len(felt) >= 300
    np.testing.assert_allclose(np.linalg.norm(felt, axis=1), 9.80665, atol=1e-5)
    np.testing.assert_array_equal(uav.position_map, start)
    np.testing.assert_array_equal(uav.attitude, attitude)
    feet = start + rotations.rotate(attitude, np.array(load_airframe(airframe).ground.feet_m))
    gaps = feet[:, 2] - simulation.world.terrain.height(feet[:, 0], feet[:, 1])
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)
    assert float(rotations.yaw_of(attitude)) == pytest.approx(np.radians(30.0), abs=0.1)
    uav.take_off(1.0)
    simulation.run(0.02)  # it wakes without a jump
    assert np.linalg.norm(uav.position_map - start) < 0.002
    assert max(np.linalg.norm(felt, axis=1)) < 15.0
    simulation.run(4.0)
    assert uav.position_map[2] - start[2] > 0.8


def gravity_alone(simulation, uav):
    """Runs for a while; asserts that the IMU of a UAV measures gravity alone and that it stands."""
    felt = []
    simulation.graph.subscribe(
        f"/{uav.name}/imu",
        lambda p: felt.append([getattr(p.message.linear_acceleration, axis) for axis in "xyz"]),
        Imu,
    )
    simulation.run(0.3)
    assert len(felt) >= 290
    np.testing.assert_allclose(np.linalg.norm(felt, axis=1), 9.80665, atol=1e-5)
    feet = rotations.rotate(uav.attitude, np.array(uav.airframe.ground.feet_m)) + uav.position_map
    gaps = feet[:, 2] - simulation.world.terrain.height(feet[:, 0], feet[:, 1])
    np.testing.assert_allclose(gaps, 0.0, atol=1e-6)
    assert uav.mode.name == "LANDED"


@pytest.fixture
def still(flat_data, tmp_path):
    """Makes a scenario with a UAV on a slope towards x, which begins at `level_m`."""

    def make(slope, position_m, level_m=0, **uav_type):
        heights = ",".join(f"{slope * max(0, x - level_m):.6f}" for x in range(13))
        rows = 13 * [heights]
        (tmp_path / "slope.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        ground = {"kind": "grid", "file": str(tmp_path / "slope.csv"), "spacing_m": 1.0}
        flat_data["world"] = {"terrain": ground}
        imu = {"kind": "imu", "noise": False, "rate_hz": 1000}
        flat_data["types"] = {"still": {"airframe": "f450", "sensors": [imu], **uav_type}}
        flat_data["uavs"] = [{"type": "still", "position_m": position_m}]
        return flat_data

    return make


@pytest.mark.parametrize("slope", [0.0, 0.3])
@pytest.mark.parametrize("height_m", [0.0, 0.001, 0.05, 0.25])
def test_wherever_a_landed_uav_is_put_on_the_ground_it_rests(simulate, still, slope, height_m):
    """At the start, by a spawn and by a teleport, with a height that is about right."""
    standing_m = 0.12 + 0.13 * slope + 1e-6

    def just_above(x):
        return [x, 3.0, slope * x + standing_m + height_m]

    simulation = simulate(still(slope, just_above(2.0)))
    uav = simulation.uavs["uav1"]
    gravity_alone(simulation, uav)
    gravity_alone(simulation, simulation.vehicles.spawn("other", "still", just_above(5.0)))
    simulation.vehicles.set_pose("uav1", just_above(8.0), (0.0, 0.0, 0.0, 1.0))
    gravity_alone(simulation, uav)
    ground = [9.0, 6.0, slope * 9.0]
    simulation.vehicles.set_pose("uav1", ground, (0.0, 0.0, 0.0, 1.0))
    gravity_alone(simulation, uav)


def test_ground_on_which_it_would_slide_is_refused(simulate, still):
    """The slope is 0.9 from x = 6 m on, and level before."""
    data = still(0.9, [9.0, 6.0], level_m=6)
    with pytest.raises(PlacementError, match=r"uav1\).*steeper than the 36 degrees on which it st"):
        simulate(data)
    data["uavs"][0]["position_m"] = [3.0, 3.0]
    simulation = simulate(data)
    steep = [9.0, 6.0, 2.7]
    with pytest.raises(PlacementError, match="other: the ground is steeper"):
        simulation.vehicles.spawn("other", "still", steep)
    with pytest.raises(PlacementError, match="uav1: the ground is steeper"):
        simulation.vehicles.set_pose("uav1", steep, (0.0, 0.0, 0.0, 1.0))
    gravity_alone(simulation, simulation.uavs["uav1"])


def test_nearest_free_finds_ground_that_holds(simulate, still):
    data = still(0.9, [8.6, 6.0], level_m=6)
    data["uavs"][0]["placement"] = "nearest_free"
    simulation = simulate(data)
    uav = simulation.uavs["uav1"]
    start = uav.position_map
    assert start[0] < 7.0
    simulation.run(0.3)
    assert uav.mode.name == "LANDED"
    np.testing.assert_array_equal(uav.position_map, start)


def test_a_kinematic_uav_stands_on_any_slope(simulate, still):
    simulation = simulate(still(0.9, [6.0, 6.0], plant="kinematic"))
    uav = simulation.uavs["uav1"]
    simulation.run(0.3)
    assert uav.mode.name == "LANDED"
    np.testing.assert_array_equal(uav.velocity_map, 0.0)


def test_missing_files_name_the_folders_searched(simulate, flat_data):
    flat_data["world"] = {"terrain": {"kind": "grid", "file": "no.csv", "spacing_m": 5.0}}
    with pytest.raises(DataFileError, match=r"no file 'no\.csv'"):
        simulate(flat_data)
    flat_data["world"] = {}
    flat_data["types"]["f450"]["airframe"] = "f45"
    with pytest.raises(DataFileError, match="did you mean 'f450'"):
        simulate(flat_data)


@pytest.mark.parametrize(
    ("node", "parameters", "words"),
    [
        ("volery.autonomy.avoidance.gap_following:Gap", {}, "has no class"),
        ("numpy:Gap", {}, "rename"),
        ("volery.no_such:Gap", {}, "cannot be imported"),
        ("volery.core.clock:Schedule", {}, "no subclass"),
        ("gap_following", {"rout": []}, "no parameter rout"),
        ("gap_following", {"speed_m_s": "x"}, "must be like"),
    ],
)
def test_nodes_that_do_not_start(simulate, flat_data, node, parameters, words):
    flat_data["types"]["f450"]["nodes"] = [{"node": node, "parameters": parameters}]
    with pytest.raises(ScenarioError, match=r"types\.f450\.nodes\[0\]") as caught:
        simulate(flat_data)
    assert words in str(caught.value)


def test_feet_in_the_ground_and_positions_beyond_the_terrain(simulate, flat_data):
    flat_data["uavs"] = [{"type": "f450", "position_m": [0.0, 0.0, 0.05]}]
    with pytest.raises(PlacementError, match="feet"):
        simulate(flat_data)
    flat_data["uavs"] = [{"type": "f450", "position_m": [9000.0, 0.0]}]
    with pytest.raises(PlacementError, match="beyond the terrain"):
        simulate(flat_data)


def test_the_ground_reaches_around_the_origin(simulate, flat_data):
    flat_data["uavs"] = [{"type": "f450", "position_m": [-40.0, -40.0]}]
    simulation = simulate(flat_data)
    hits = simulation.world.scene.cast([[-40.0, -40.0, 5.0]], [[0.0, 0.0, -1.0]], 30.0)
    assert hits.distance[0] == pytest.approx(5.0)


def test_trees_beyond_the_terrain_or_none_at_all(simulate, flat_data, tmp_path):
    trees = tmp_path / "trees.csv"
    trees.write_text("x_m,y_m\n5000,5\n")
    forest = {"kind": "inventory", "file": str(trees), "species": "broadleaf"}
    flat_data["world"] = {"forest": forest}
    with pytest.raises(ScenarioError, match=r"world\.forest: 1 tree beyond"):
        simulate(flat_data)
    forest["region_m"] = [0, 0, 10, 10]
    with pytest.raises(ScenarioError, match="no tree there"):
        simulate(flat_data)
    forest["species"] = "brodleaf"
    with pytest.raises(ScenarioError, match=r"flat: world\.forest: .*broadleaf"):
        simulate(flat_data)
