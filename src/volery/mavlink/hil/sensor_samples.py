"""Reads a UAV's sensor values from their messages on the graph."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from volery.mavlink.autopilot.vehicle import Vector
from volery.mavlink.hil.protocol import Fix, Inertial, SensorValues

TOPICS = {
    "imu": "sensor_msgs/msg/Imu",
    "mag": "sensor_msgs/msg/MagneticField",
    "pressure": "sensor_msgs/msg/FluidPressure",
    "pressure/temperature": "sensor_msgs/msg/Temperature",
    "fix": "sensor_msgs/msg/NavSatFix",
    "fix_velocity": "geometry_msgs/msg/TwistWithCovarianceStamped",
}
"""Message types by topic below a UAV's name."""
_NOWHERE = Fix(math.nan, math.nan, math.nan, (0.0, 0.0, 0.0), 0.0, 0.0)


class SensorSamples:
    """Reads one UAV's sensors; remembers the air temperature."""

    def __init__(self) -> None:
        self._temperature = 20.0

    def read(self, news: Mapping[str, Any]) -> SensorValues | None:
        """Returns what is new in the messages by topic; None without a sample of the IMU."""
        imu = news.get("imu")
        if imu is None:
            return None
        if "pressure/temperature" in news:
            self._temperature = float(news["pressure/temperature"].temperature)
        field, pressure = news.get("mag"), news.get("pressure")
        return SensorValues(
            inertial_of(imu),
            None if field is None else parts(field.magnetic_field),
            None if pressure is None else float(pressure.fluid_pressure),
            self._temperature,
            _fix_of(news),
        )


def inertial_of(imu: Any) -> Inertial:
    """Returns specific force and rates of an Imu message."""
    return Inertial(parts(imu.linear_acceleration), parts(imu.angular_velocity))


def parts(vector: Any) -> Vector:
    """Returns the three numbers of a Vector3 or Point."""
    return float(vector.x), float(vector.y), float(vector.z)


def _fix_of(news: Mapping[str, Any]) -> Fix | None:
    fix = news.get("fix")
    if fix is None:
        return None
    if fix.status.status < 0:
        return _NOWHERE
    velocity = news.get("fix_velocity")
    speed = (0.0, 0.0, 0.0) if velocity is None else parts(velocity.twist.twist.linear)
    level, upright = (math.sqrt(max(fix.position_covariance[k], 0.0)) for k in (0, 8))
    return Fix(fix.latitude, fix.longitude, fix.altitude, speed, level, upright)
