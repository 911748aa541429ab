"""Measuring ranges: full scales of the data sheets, on each axis and after all errors."""

import math

import numpy as np
import pytest
from navigation_bench import NS, ZURICH, fleet_of, gnss_bank, group_of, keys_of, put

from volery.core.errors import DataFileError
from volery.sensors.barometer import BarometerBank, BarometerModel
from volery.sensors.gnss import GnssModel
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.magnetometer import MagnetometerBank, MagnetometerModel

G = 9.80665
PERIOD = NS // 5


def imus(count=1, *, noise=True, model="adis16448", **changes):
    model = ImuModel.load(model).model_copy(update=changes)
    return ImuBank(model, group_of(count, "imu", 200.0, keys_of(count) if noise else None))


def shaken(acceleration=(0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0)):
    fleet = fleet_of()
    fleet.state.acceleration_map[:] = acceleration
    fleet.state.omega_body[:] = omega
    return fleet


@pytest.mark.parametrize(
    ("model", "gyro_deg_s", "accel_g"), [("adis16448", 1000.0, 18.0), ("iim42653", 4000.0, 32.0)]
)
def test_imus_have_the_full_scale_of_their_data_sheets(model, gyro_deg_s, accel_g):
    found = ImuModel.load(model)
    assert math.degrees(found.gyro_range_rad_s) == pytest.approx(gyro_deg_s, rel=1e-4)
    assert found.accel_range_m_s2 / G == pytest.approx(accel_g, rel=1e-4)


def test_imu_is_cut_at_full_scale_on_each_axis():
    fleet = shaken([590.0, -3.0, -800.0], [-80.0, 2.0, 18.0])
    reading = imus(noise=False).sample(0, 0, fleet)
    np.testing.assert_allclose(reading.specific_force, [[176.52, -3.0, -176.52]])
    np.testing.assert_allclose(reading.angular_velocity, [[-17.4533, 2.0, 17.4533]])


def test_errors_come_before_the_cut():
    """A measurement close to the full scale is clipped there, whatever its noise adds."""
    fleet = shaken([176.5, 0.0, 0.0])
    bank = imus(500)
    forces = np.array([bank.sample(k, 0, fleet).specific_force[:, 0] for k in range(20)])
    assert forces.max() == 176.52
    assert (forces == 176.52).mean() == pytest.approx(0.5, abs=0.1)
    free = imus(500, accel_range_m_s2=None)
    assert free.sample(0, 0, fleet).specific_force.max() > 176.6


def test_the_cut_leaves_later_noise_unchanged():
    cut, free = imus(3), imus(3, accel_range_m_s2=None, gyro_range_rad_s=None)
    shock, still = shaken([900.0, 0.0, 0.0], [0.0, 99.0, 0.0]), shaken()
    for bank in (cut, free):
        bank.sample(0, 0, shock)
    after, expected = (bank.sample(1, 0, still) for bank in (cut, free))
    assert after.specific_force.tobytes() == expected.specific_force.tobytes()
    assert after.angular_velocity.tobytes() == expected.angular_velocity.tobytes()


def test_sensors_of_a_batch_are_cut_as_alone():
    fleet = shaken([176.5, -176.4, 170.0], [17.45, 0.0, -17.45])
    many = imus(5).sample(0, 0, fleet)
    for i in range(5):
        alone = ImuBank(
            ImuModel.load("adis16448"), group_of(1, "imu", 200.0, keys_of(1, 11 + i))
        ).sample(0, 0, fleet)
        assert alone.specific_force.tobytes() == many.specific_force[i : i + 1].tobytes()
        assert alone.angular_velocity.tobytes() == many.angular_velocity[i : i + 1].tobytes()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("accel_range_m_s2", "8.0"),
        ("accel_range_m_s2", "18.0"),  # in g
        ("accel_range_m_s2", "nan"),
        ("gyro_range_rad_s", "1000.0"),  # in deg/s
        ("gyro_range_rad_s", "0.0"),
        ("gyro_range_rad_s", "nan"),
    ],
)
def test_ranges_of_another_unit_are_refused(tmp_path, key, value):
    path = tmp_path / "imu.toml"
    path.write_text(f'base = "adis16448"\n{key} = {value}\n', encoding="utf-8")
    with pytest.raises(DataFileError, match=key):
        ImuModel.load(str(path))


@pytest.mark.parametrize(
    ("key", "value"), [("accel_range_m_s2", 19.613), ("gyro_range_rad_s", 349)]
)
def test_ranges_of_data_sheets_are_possible(tmp_path, key, value):
    path = tmp_path / "imu.toml"
    path.write_text(f'base = "adis16448"\n{key} = {value}\n', encoding="utf-8")
    assert getattr(ImuModel.load(str(path)), key) == value


def test_magnetometer_is_cut_at_full_scale():
    model = MagnetometerModel.load("magnetometer_px4").model_copy(
        update={"hard_iron_t": (2e-3, -1e-3, -3e-3)}
    )
    bank = MagnetometerBank(model, group_of(1, "mag", 100.0, None), np.zeros(3))
    field = bank.sample(0, 0, fleet_of()).field
    np.testing.assert_allclose(field, [[1.6e-3, -1e-3, -2.5e-3]])


@pytest.mark.parametrize(
    ("altitude", "pascal"), [(0.0, 101_325.0), (40_000.0, 1000.0), (-3000.0, 120_000.0)]
)
def test_barometer_is_cut_at_its_range(altitude, pascal):
    model = BarometerModel.load("barometer_px4")
    bank = BarometerBank(model, group_of(1, "pressure", 50.0, None), altitude)
    fleet = fleet_of(position=(0.0, 0.0, 0.0))
    assert bank.sample(0, 0, fleet).pressure[0] == pytest.approx(pascal)


def test_a_barometer_range_the_wrong_way_round_is_refused(tmp_path):
    path = tmp_path / "barometer.toml"
    path.write_text('base = "barometer_px4"\nrange_min_pa = 130000.0\n', encoding="utf-8")
    with pytest.raises(DataFileError, match="range_min_pa must be less than range_max_pa"):
        BarometerModel.load(str(path))


def moving(fleet, velocity):
    """Let all UAVs have flown straight up to now, to where they are."""
    history = fleet.history
    rows = len(history.position)
    dt = history.dt_ns / NS
    for k in range(rows):
        history.position[k] = fleet.state.position_map[0] + np.array(velocity) * k * dt


def test_no_fix_beyond_the_receivers_altitude():
    fleet, bank = fleet_of(), gnss_bank()
    top = 50_000.0 - ZURICH.altitude_m
    for k, (z, has_fix) in enumerate([(top - 1.0, True), (top + 1.0, False), (top - 1.0, True)]):
        put(fleet, [0.0, 0.0, z])
        reading = bank.sample(k, k * PERIOD, fleet)
        assert reading.has_fix[0] == has_fix  # it tracks all the while: back at once
        assert np.isfinite(reading.position_map).all() == has_fix


def test_no_fix_beyond_the_receivers_speed():
    fleet = fleet_of()
    for speed, has_fix in ((499.0, True), (501.0, False)):
        moving(fleet, [speed, 0.0, 0.0])
        assert gnss_bank().sample(0, 50_000_000, fleet).has_fix[0] == has_fix


@pytest.mark.parametrize(("change", "has_fix"), [(7.5, True), (8.2, False)])
def test_more_than_four_g_from_fix_to_fix_ends_the_tracking(change, has_fix):
    """39.2 m/s^2 over 0.2 s is a change by 7.85 m/s; signals return after a second."""
    fleet, bank = fleet_of(), gnss_bank()
    moving(fleet, [0.0, 0.0, 0.0])
    assert bank.sample(0, 50_000_000, fleet).has_fix[0]
    moving(fleet, [0.0, change, 0.0])
    fixes = [bank.sample(k, 50_000_000 + k, fleet).has_fix[0] for k in (1, 2)]
    assert fixes == [has_fix, has_fix]
    assert bank.sample(3, 50_000_001 + NS, fleet).has_fix[0]


def test_a_new_receiver_knows_no_velocity_before():
    fleet, bank = fleet_of(), gnss_bank()
    moving(fleet, [0.0, 0.0, 0.0])
    bank.sample(0, 50_000_000, fleet)
    bank.reset(None, None, PERIOD, 1)
    moving(fleet, [20.0, 0.0, 0.0])
    assert bank.sample(1, 50_000_000, fleet).has_fix[0]


def test_models_without_ranges_are_unlimited():
    limits = ("altitude_max_m", "speed_max_m_s", "acceleration_max_m_s2")
    fleet, bank = fleet_of(), gnss_bank(**dict.fromkeys(limits))
    put(fleet, [0.0, 0.0, 90_000.0])
    assert bank.sample(0, 0, fleet).has_fix[0]
    moving(fleet, [900.0, 0.0, 0.0])
    assert bank.sample(1, 50_000_000, fleet).has_fix[0]
    assert all(getattr(GnssModel.load("gnss_f9p_rtk"), limit) for limit in limits)
