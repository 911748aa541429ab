"""Typed samples of a UAV's sensors: the same numbers as on the topics, without copies."""

import numpy as np
import pytest

from volery.core.errors import CommandError, SensorError
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario
from volery.sensors.sensor_samples import (
    BatterySample,
    CameraSample,
    GnssSample,
    ImuSample,
    LidarSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
)
from volery.vehicle.battery import BatteryLevel

CAMERA = {"kind": "camera", "name": "front", "width": 32, "height": 24, "rate_hz": 20.0}


@pytest.fixture
def all_data(flat_data):
    """A UAV with a sensor of each kind that hovers beside a second one."""
    flat_data["types"]["f450"]["sensors"] += [
        {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
        {"kind": "gnss", "name": "gnss"},
        {"kind": "barometer", "name": "barometer"},
        {"kind": "magnetometer", "name": "magnetometer"},
        {"kind": "battery", "name": "battery"},
        CAMERA,
    ]
    flat_data["world"] = {"origin": {"latitude_deg": 48.0, "longitude_deg": 11.0}}
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 2.0]},
        {"type": "f450", "position_m": [3.0, 0.0, 2.0]},
    ]
    return flat_data


def test_every_kind_has_its_class_with_read_only_arrays(simulate, all_data):
    simulation = simulate(all_data)
    sensors = simulation.uavs["uav1"].sensors
    simulation.run(0.6)
    assert list(sensors) == [
        *("imu", "range", "odom", "ground_truth", "horizontal", "gnss", "barometer"),
        *("magnetometer", "battery", "front"),
    ]
    assert len(sensors) == 10
    kinds = {
        "imu": ImuSample,
        "range": RangeSample,
        "odom": PoseSample,
        "ground_truth": PoseSample,
        "horizontal": LidarSample,
        "gnss": GnssSample,
        "barometer": PressureSample,
        "magnetometer": MagneticSample,
        "battery": BatterySample,
        "front": CameraSample,
    }
    for name, kind in kinds.items():
        sample = sensors[name].next()
        assert type(sample) is kind
        assert sample.stamp_s == pytest.approx(simulation.time_s, abs=0.3)
        for field, value in vars(sample).items():
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable, f"{name}.{field}"
    assert sensors["battery"].latest.level is BatteryLevel.NORMAL
    assert sensors["gnss"].latest.has_fix is True
    assert sensors["gnss"].latest.geodetic[0] == pytest.approx(np.radians(48.0), abs=1e-5)
    assert sensors["barometer"].latest.pressure == pytest.approx(
        95_600.0, rel=0.01
    )  # 488 m above the sea
    assert isinstance(sensors["range"].latest.range, float)
    assert sensors["imu"].latest.specific_force[2] == pytest.approx(9.81, abs=1.5)
    truth = sensors["ground_truth"].latest
    assert truth.is_ground_truth
    np.testing.assert_allclose(truth.position_odom, simulation.uavs["uav1"].position_map, atol=0.1)


def test_samples_equal_the_messages_of_the_topics(simulate, all_data):
    simulation = simulate(all_data)
    sensors = simulation.uavs["uav2"].sensors
    seen = {}
    for topic in ("laser/horizontal/scan", "imu", "front/image_raw", "front/depth"):
        simulation.graph.subscribe(f"/uav2/{topic}", lambda p, t=topic: seen.update({t: p.message}))
    simulation.run(0.5)
    scan = sensors["horizontal"].latest
    np.testing.assert_array_equal(scan.ranges, seen["laser/horizontal/scan"].ranges)
    assert sensors["imu"].latest.specific_force[0] == seen["imu"].linear_acceleration.x
    assert not sensors["front"].has_sample  # no caller has requested all parts yet
    with pytest.raises(SensorError, match=r"'front' of uav2 has no sample yet: it renders from"):
        _ = sensors["front"].latest
    simulation.run(0.1)
    image = sensors["front"].latest
    assert image.image.tobytes() == bytes(seen["front/image_raw"].data)
    np.testing.assert_array_equal(
        image.depth.ravel(), np.frombuffer(seen["front/depth"].data, "<f4")
    )
    assert image.image.shape == (24, 32, 3)
    assert image.instance.shape == image.material.shape == image.depth.shape == (24, 32)
    assert image.intrinsics.shape == (3, 3)
    assert image.points_optical().shape == (24, 32, 3)


def test_samples_are_views_that_later_measurements_do_not_change(simulate, all_data):
    simulation = simulate(all_data)
    sensors = simulation.uavs["uav1"].sensors
    simulation.run(0.3)
    scan, other = sensors["horizontal"].latest, simulation.uavs["uav2"].sensors["horizontal"].latest
    assert np.shares_memory(scan.echoes, sensors["horizontal"].latest.echoes)
    assert scan.echoes.base is other.echoes.base  # one batch of all UAVs
    before = scan.ranges.copy()
    simulation.uavs["uav1"].command_velocity([2.0, 0.0, 0.0])
    simulation.run(0.5)
    np.testing.assert_array_equal(scan.ranges, before)
    assert sensors["horizontal"].latest.stamp_ns > scan.stamp_ns
    with pytest.raises(ValueError, match="read-only"):
        scan.ranges[0] = 1.0


def test_errors_name_what_exists(simulate, all_data):
    simulation = simulate(all_data)
    sensors = simulation.uavs["uav1"].sensors
    with pytest.raises(KeyError, match=r"uav1 has no sensor 'lidar': each .* Known: imu, range"):
        sensors["lidar"]
    assert "lidar" not in sensors
    with pytest.raises(SensorError, match="'imu' of uav1 has no sample yet: run the simulation"):
        _ = sensors["imu"].latest
    with pytest.raises(CommandError, match="depth must be at least 1, not 0"):
        sensors["imu"].samples(depth=0)
    simulation.faults.inject(
        {"kind": "sensor", "uav": "uav1", "sensor": "range", "effect": "dropped"}
    )
    simulation.run(0.1)
    with pytest.raises(SensorError, match=r"'range' of uav1 sends no sample within 0\.5 s"):
        sensors["range"].next(timeout_s=0.5)
    assert repr(sensors["imu"]) == "<sensor 'imu' of uav1>"
    assert repr(sensors).startswith("<sensors of uav1: imu, range")


def test_a_loop_over_samples_advances_the_simulation(simulate, all_data):
    simulation = simulate(all_data)
    sensors = simulation.uavs["uav1"].sensors
    stamps = [scan.stamp_ns for scan in sensors["horizontal"].samples(seconds=1.0)]
    assert len(stamps) == 40
    assert stamps == sorted(set(stamps))
    assert simulation.time_s == 1.0
    stream = sensors["imu"].samples()
    simulation.run(0.1)
    taken = stream.take()
    assert len(taken) >= 5
    assert stream.take() == []
    assert next(stream).stamp_ns > taken[-1].stamp_ns
    short = sensors["imu"].samples(depth=2)
    simulation.run(0.1)
    newest = [sample.stamp_ns for sample in stream.take()][-2:]
    assert [sample.stamp_ns for sample in short.take()] == newest
    simulation.run(0.1)
    stream.close()
    assert len(list(stream)) >= 5  # what is queued; then the loop ends without a step
    before = simulation.time_ns
    simulation.run(0.1)
    assert stream.take() == []
    assert simulation.time_ns > before


def test_a_loop_ends_with_the_scenario(simulate, flat_data):
    simulation = simulate({**flat_data, "duration_s": 0.5})
    stamps = [sample.stamp_s for sample in simulation.uavs["uav1"].sensors["range"].samples()]
    assert stamps
    assert simulation.clock.finished


def test_resets_snapshots_and_deleted_uavs(simulate, all_data):
    simulation = simulate(all_data)
    gone = simulation.uavs["uav1"]
    imu = gone.sensors["imu"]
    simulation.run(0.5)
    snapshot, then = simulation.snapshot(), imu.latest
    stream = imu.samples()
    simulation.run(0.5)
    simulation.restore(snapshot)
    assert imu.latest.stamp_ns == then.stamp_ns
    np.testing.assert_array_equal(imu.latest.specific_force, then.specific_force)
    assert stream.take() == []
    simulation.vehicles.reset("uav1")
    assert simulation.uavs["uav2"].sensors["imu"].has_sample
    simulation.run(0.1)
    simulation.vehicles.delete("uav1")
    other = simulation.uavs["uav2"].sensors["imu"]
    assert other.has_sample  # of before the fleet changed
    assert dict(gone.sensors) == {}
    with pytest.raises(KeyError, match=r"uav1 has no sensor 'imu'[.] Known: none"):
        gone.sensors["imu"]
    with pytest.raises(SensorError, match="uav1 has no sensor 'imu'"):
        _ = imu.latest
    simulation.reset()
    assert not simulation.uavs["uav1"].sensors["imu"].has_sample


def test_environments_of_one_thread_are_read_without_copies(flat_data):
    with VectorizedSimulation(parse_scenario(flat_data), 3, threads=1) as envs:
        envs.run(0.1)
        imu = envs.sensors["uav1"]["imu"]
        assert np.shares_memory(imu.latest.specific_force, imu.latest.specific_force)
        assert not imu.latest.specific_force.flags.writeable


def test_environments_have_the_same_names(simulate, flat_data):
    flat_data["types"]["f450"]["sensors"].append({"kind": "lidar", "name": "horizontal"})
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 2.0]
    with VectorizedSimulation(parse_scenario(flat_data), 3, seeds=[4, 5, 6], threads=2) as envs:
        sensors = envs.sensors["uav1"]
        assert set(sensors) == set(simulate(flat_data).uavs["uav1"].sensors)
        assert not sensors["imu"].has_sample.any()
        with pytest.raises(SensorError, match="run the environments first"):
            _ = sensors["imu"].latest
        with pytest.raises(KeyError, match=r"each lidar goes by its name, 'horizontal'[.] Known: "):
            sensors["lidar"]
        envs.run(0.35)
        scan, imu = sensors["horizontal"].latest, sensors["imu"].latest
        assert scan.ranges.shape == (3, scan.model.scan.beams)
        assert scan.points_base().shape == (3, scan.model.scan.beams, 3)
        assert imu.specific_force.shape == (3, 3)
        assert sensors["range"].latest.range.shape == (3,)
        for env, seed in enumerate((4, 5, 6)):
            alone = simulate({**flat_data, "seed": seed})
            alone.run(0.35)
            expected = alone.uavs["uav1"].sensors
            own = envs.uav(env, "uav1").sensors
            np.testing.assert_array_equal(
                imu.specific_force[env], expected["imu"].latest.specific_force
            )
            np.testing.assert_array_equal(scan.ranges[env], expected["horizontal"].latest.ranges)
            np.testing.assert_array_equal(own["horizontal"].latest.ranges, scan.ranges[env])
            found, row = own["horizontal"].latest.points_base(), scan.points_base()[env]
            np.testing.assert_array_equal(found, row[~np.isnan(row[:, 0])])
        with pytest.raises(CommandError, match="environments advance together"):
            envs.uav(1, "uav1").sensors["imu"].next()
        envs.step(3)
        envs.reset([1])
        assert sensors["horizontal"].has_sample.tolist() == [True, False, True]
        after = sensors["horizontal"].latest
        assert np.isnan(after.ranges[1]).all()
        assert not np.isnan(after.ranges[[0, 2]]).any()
        assert not after.ranges.flags.writeable
        with pytest.raises(SensorError, match="of 1/uav1 has no sample yet"):
            _ = envs.uav(1, "uav1").sensors["horizontal"].latest


def test_a_sensor_is_found_by_its_kind_where_it_is_the_only_one(simulate, flat_data):
    """Scenarios name the GNSS `fix` after its topic; people look for the kind."""
    flat_data["types"]["f450"]["sensors"] += [
        {"kind": "gnss"},
        {"kind": "barometer"},
        {"kind": "lidar", "name": "left"},
    ]
    simulation = simulate(flat_data)
    sensors = simulation.uavs["uav1"].sensors
    assert [sensors[kind].name for kind in ("gnss", "barometer")] == ["fix", "pressure"]
    assert "gnss" in sensors
    assert isinstance(sensors["gnss"].next(), GnssSample)
    assert "gnss" not in list(sensors)
    with pytest.raises(SensorError, match=r"no sensor 'lidar': each .* name, 'left'"):
        sensors["lidar"]
    with pytest.raises(SensorError, match=r"no sensor 'gps'.* Known: .*fix"):
        sensors["gps"]
    with VectorizedSimulation(parse_scenario(flat_data), 2) as envs:
        assert envs.sensors["uav1"]["gnss"].name == "fix"
        assert envs.uav(1, "uav1").sensors["gnss"].name == "fix"


@pytest.mark.parametrize(
    ("wanted", "meant"),
    [("IMU", "imu"), ("gps", "gnss"), ("Ground Truth", "ground_truth"), ("barometr", "barometer")],
)
def test_a_misspelt_sensor_is_suggested(simulate, all_data, wanted, meant):
    sensors = simulate(all_data).uavs["uav1"].sensors
    with pytest.raises(
        SensorError, match=rf"no sensor '{wanted}'; did you mean '{meant}'\? Known: "
    ):
        sensors[wanted]
    with pytest.raises(SensorError, match=r"Known: .*front$"):
        sensors["xyz"]
