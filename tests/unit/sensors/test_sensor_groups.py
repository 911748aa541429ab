"""Groups of sensors, as banks take them."""

import numpy as np

from volery.core.clock import Schedule
from volery.sensors.bank import SensorGroup
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.mount import make_mount
from volery.sensors.odometry import GroundTruthBank
from volery.sensors.samples import SensorId

MOUNTS = (make_mount((0.1, 0.0, 0.2)), make_mount(attitude_body=(0.0, 0.0, 2.0, 0.0)))
SENSORS = (SensorId(0, "uav1", "imu"), SensorId(3, "uav4", "imu"))


def test_poses_are_rows_of_the_sensors_mounts():
    group = SensorGroup(Schedule.from_hz(50.0), SENSORS, MOUNTS)
    np.testing.assert_array_equal(group.position_body, [[0.1, 0.0, 0.2], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(group.attitude_body, [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    assert group.keys is None


def test_banks_have_schedule_and_sensors_of_their_group():
    keys = np.arange(2, dtype=np.uint64)
    group = SensorGroup(Schedule.from_hz(50.0), SENSORS, MOUNTS, keys)
    for bank in (GroundTruthBank(group), ImuBank(ImuModel.load("adis16448"), group)):
        assert bank.schedule is group.schedule
        assert bank.sensors is SENSORS
