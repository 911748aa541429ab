"""Pressure of the standard atmosphere, and the field turned into the sensor's axes."""

import math

import numpy as np
import pytest
from navigation_bench import LEVEL, fleet_of, group_of, keys_of, put

from volery.core import rotations
from volery.sensors.barometer import BarometerBank, BarometerModel
from volery.sensors.magnetometer import MagnetometerBank, MagnetometerModel
from volery.world.magnetic_field import field_of_angles

FIELD = np.array([1.3e-6, 21.5e-6, -43.2e-6])


def barometers(count=1, *, noise=False, altitude=488.0, lever=(0.0, 0.0, 0.0), **changes):
    model = BarometerModel.load("barometer_px4").model_copy(update=changes)
    keys = keys_of(count) if noise else None
    group = group_of(count, "pressure", 50.0, keys, position_body=lever)
    return BarometerBank(model, group, altitude)


def magnetometers(count=1, *, noise=False, turn=LEVEL, field=FIELD, **changes):
    model = MagnetometerModel.load("magnetometer_px4").model_copy(update=changes)
    keys = keys_of(count) if noise else None
    group = group_of(count, "mag", 100.0, keys, attitude_body=turn)
    return MagnetometerBank(model, group, field)


@pytest.mark.parametrize(
    ("altitude", "pascal"), [(0.0, 101_325.0), (1000.0, 89_874.6), (5000.0, 54_019.9)]
)
def test_pressure_is_that_of_the_tables(altitude, pascal):
    fleet = fleet_of(position=(3.0, -4.0, 100.0))
    reading = barometers(altitude=altitude - 100.0).sample(0, 0, fleet)
    assert reading.pressure[0] == pytest.approx(pascal, rel=1e-5)
    assert reading.temperature[0] == pytest.approx(288.15 - 0.0065 * altitude)


def test_pressure_is_felt_where_the_sensor_sits():
    """Upside down, a sensor on top hangs below; 1 m of air weighs about 11.4 Pa at 488 m."""
    fleet, bank = fleet_of(position=(0.0, 0.0, 0.0)), barometers(lever=(0.0, 0.0, 0.5))
    upright = bank.sample(0, 0, fleet).pressure[0]
    put(fleet, [0.0, 0.0, 0.0], rotations.from_rpy(math.pi, 0.0, 0.0))
    assert bank.sample(1, 0, fleet).pressure[0] - upright == pytest.approx(11.46, abs=0.1)


def test_barometer_noise_and_drift():
    model, fleet = BarometerModel.load("barometer_px4"), fleet_of()
    bank, truth = barometers(4000, noise=True), barometers().sample(0, 0, fleet).pressure[0]
    samples = [bank.sample(k, 0, fleet) for k in range(40)]
    error = np.array([r.pressure for r in samples]) - truth
    assert error[0].std() == pytest.approx(math.hypot(model.drift_pa, model.noise_pa), rel=0.05)
    # Neighbours share the drift: half the variance of their difference is the white noise's.
    assert np.diff(error, axis=0).std() / math.sqrt(2.0) == pytest.approx(model.noise_pa, rel=0.02)
    assert samples[0].pressure_variance == model.noise_pa**2


def test_barometer_drift_forgets_in_its_correlation_time():
    fleet, tau = fleet_of(), 1.0
    bank = barometers(4000, noise=True, noise_pa=0.0, drift_pa=5.0, drift_correlation_s=tau)
    error = np.array([bank.sample(k, 0, fleet).pressure for k in range(101)])
    error -= error.mean(axis=1, keepdims=True)
    for k in (0, 50, 100):
        assert error[k].std() == pytest.approx(5.0, rel=0.05)
    together = (error[0] * error[50]).mean() / 25.0
    assert together == pytest.approx(math.exp(-1.0 / tau), abs=0.05)


@pytest.mark.parametrize(
    ("rpy_deg", "mount_deg"),
    [
        ((0, 0, 0), (0, 0, 0)),
        ((0, 0, 90), (0, 0, 0)),
        ((30, 0, 0), (0, 0, 0)),
        ((0, -20, 0), (0, 0, 0)),
        ((25, -40, 160), (0, 0, 0)),
        ((-10, 35, -75), (180, 0, 90)),
    ],
)
def test_field_is_turned_into_the_sensor(rpy_deg, mount_deg):
    """Against rotation matrices written out here: Rz Ry Rx of body and mount."""
    body, mount = (matrix_of(angles) for angles in (rpy_deg, mount_deg))
    fleet = fleet_of()
    put(fleet, [0.0, 0.0, 5.0], rotations.from_rpy(*np.radians(rpy_deg)))
    bank = magnetometers(turn=rotations.from_rpy(*np.radians(mount_deg)))
    expected = (body @ mount).T @ FIELD
    np.testing.assert_allclose(bank.sample(0, 0, fleet).field[0], expected, atol=1e-18)


def matrix_of(rpy_deg):
    (sr, sp, sy), (cr, cp, cy) = np.sin(np.radians(rpy_deg)), np.cos(np.radians(rpy_deg))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def test_a_uav_that_faces_north_feels_the_field_ahead_and_below():
    fleet = fleet_of()
    put(fleet, [0.0, 0.0, 5.0], rotations.from_rpy(0.0, 0.0, math.pi / 2))
    field = magnetometers(field=field_of_angles(0.0, math.radians(60.0), 5e-5)).sample(0, 0, fleet)
    np.testing.assert_allclose(field.field[0], [2.5e-5, 0.0, -4.330127e-5], atol=1e-11)


def test_iron_distorts():
    soft = ((1.1, 0.02, 0.0), (0.02, 0.95, 0.0), (0.0, 0.0, 1.0))
    bank = magnetometers(hard_iron_t=(1e-6, -2e-6, 3e-6), soft_iron=soft)
    expected = np.array(soft) @ FIELD + [1e-6, -2e-6, 3e-6]
    np.testing.assert_allclose(bank.sample(0, 0, fleet_of()).field[0], expected, atol=1e-18)


def test_magnetometer_noise_and_walk():
    model, fleet, seconds = MagnetometerModel.load("magnetometer_px4"), fleet_of(), 4
    bank = magnetometers(2000, noise=True)
    samples = [bank.sample(k, 0, fleet) for k in range(100 * seconds)]
    white = model.noise_density_t_sqrt_hz * math.sqrt(100.0)
    error = np.array([r.field for r in samples[:20]]) - FIELD
    assert error.std() == pytest.approx(white, rel=0.01)
    assert samples[0].field_variance == pytest.approx(white**2)
    walked = bank.get_state()["bias"].std()
    assert walked == pytest.approx(model.random_walk_t_s_sqrt_hz * math.sqrt(seconds), rel=0.05)


def test_messages_have_ros_units(simulate, flat_data):
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "barometer", "noise": False},
        {"kind": "magnetometer", "noise": False},
    ]
    flat_data["world"] = {
        "origin": {"altitude_m": 999.5},
        "magnetic_field": {"declination_deg": 90.0, "inclination_deg": 0.0, "strength_ut": 50.0},
    }
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 0.5]
    simulation, got = simulate(flat_data), {}
    for topic in ("pressure", "pressure/temperature", "mag"):
        simulation.graph.subscribe(
            f"/uav1/{topic}", lambda m, topic=topic: got.setdefault(topic, m.message)
        )
    simulation.run(0.01)
    assert got["pressure"].fluid_pressure == pytest.approx(89_874.6, abs=0.5)
    assert got["pressure/temperature"].temperature == pytest.approx(8.5, abs=0.01)
    field = got["mag"].magnetic_field  # the UAV faces east, where the field points
    assert (field.x, field.y, field.z) == pytest.approx((5e-5, 0.0, 0.0), abs=1e-8)
    assert {m.header.frame_id for m in got.values()} == {"uav1/pressure", "uav1/mag"}


def test_the_field_follows_the_origin_where_nothing_is_stated(simulate, flat_data):
    flat_data["types"]["f450"]["sensors"] = [{"kind": "magnetometer", "noise": False}]
    flat_data["world"] = {"magnetic_field": {"declination_deg": -10.0}}
    simulation, got = simulate(flat_data), []
    simulation.graph.subscribe("/uav1/mag", lambda m: got.append(m.message.magnetic_field))
    simulation.run(0.01)
    strength = math.hypot(got[0].x, got[0].y, got[0].z)
    # Zurich, IGRF-14 at 2025: 48.3 microtesla, 63.5 degrees below the horizon.
    assert strength == pytest.approx(48.3e-6, abs=0.1e-6)
    assert math.degrees(math.asin(-got[0].z / strength)) == pytest.approx(63.5, abs=0.1)
    assert math.degrees(math.atan2(got[0].x, got[0].y)) == pytest.approx(-10.0, abs=0.1)
