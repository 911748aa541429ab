"""Converts samples of navigation sensors to ROS messages, row by row."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.core.arrays import read_only
from volery.graph.messages import (
    FluidPressure,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    Temperature,
    Twist,
    TwistWithCovariance,
    TwistWithCovarianceStamped,
    Vector3,
    header,
)
from volery.publishing.sensor_topics import SensorTopic
from volery.sensors.samples import GnssSamples, MagneticSamples, PressureSamples, SensorId

_ZERO_CELSIUS_K = 273.15
_NOT_MEASURED = -1.0
"""Variance of a quantity of the message that the sensor does not measure (sensor_msgs/Imu)."""


def fix(readings: GnssSamples, row: int) -> NavSatFix:
    """Returns the position; without a fix, NaN with unknown covariance."""
    latitude, longitude, altitude = readings.frame.geodetic_from_enu(readings.position_map[row])
    has_fix = bool(readings.has_fix[row])
    status = NavSatStatus.STATUS_FIX if has_fix else NavSatStatus.STATUS_NO_FIX
    variance = readings.position_variance[row] if has_fix else np.zeros(3)
    return NavSatFix(
        header(readings.stamp_ns, _frame(readings.sensors[row])),
        # The stubs of the type store name another release's status here.
        NavSatStatus(status, NavSatStatus.SERVICE_GPS),  # type: ignore[arg-type]
        float(np.degrees(latitude)),
        float(np.degrees(longitude)),
        float(altitude),
        read_only(np.diag(variance).reshape(9)),
        NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN if has_fix else NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )


def fix_velocity(readings: GnssSamples, row: int) -> TwistWithCovarianceStamped | None:
    """Returns the velocity along the map's axes; None without a fix."""
    if not readings.has_fix[row]:
        return None
    variance = np.concatenate([readings.velocity_variance[row], np.full(3, _NOT_MEASURED)])
    return TwistWithCovarianceStamped(
        header(readings.stamp_ns, "map"),
        TwistWithCovariance(
            Twist(Vector3(*readings.velocity_map[row].tolist()), Vector3(0.0, 0.0, 0.0)),
            read_only(np.diag(variance).reshape(36)),
        ),
    )


def pressure(readings: PressureSamples, row: int) -> FluidPressure:
    """Returns the static pressure, Pa."""
    return FluidPressure(
        header(readings.stamp_ns, _frame(readings.sensors[row])),
        float(readings.pressure[row]),
        readings.pressure_variance,
    )


def temperature(readings: PressureSamples, row: int) -> Temperature:
    """Returns the temperature of the air, degrees Celsius."""
    return Temperature(
        header(readings.stamp_ns, _frame(readings.sensors[row])),
        float(readings.temperature[row]) - _ZERO_CELSIUS_K,
        0.0,
    )


def magnetic_field(readings: MagneticSamples, row: int) -> MagneticField:
    """Returns the magnetic flux density in the sensor's frame, T."""
    return MagneticField(
        header(readings.stamp_ns, _frame(readings.sensors[row])),
        Vector3(*readings.field[row].tolist()),
        read_only(np.diag([readings.field_variance] * 3).reshape(9)),
    )


NAVIGATION_TOPICS: dict[type[Any], tuple[SensorTopic, ...]] = {
    GnssSamples: (
        SensorTopic("", NavSatFix, fix),
        SensorTopic("_velocity", TwistWithCovarianceStamped, fix_velocity),
    ),
    PressureSamples: (
        SensorTopic("", FluidPressure, pressure),
        SensorTopic("/temperature", Temperature, temperature),
    ),
    MagneticSamples: (SensorTopic("", MagneticField, magnetic_field),),
}
"""Topics of each kind of samples."""


def _frame(sensor: SensorId) -> str:
    return f"{sensor.uav_name}/{sensor.name}"
