"""Connects a simulated UAV to a real PX4: sensors out, rotors in, in lock step.

The protocol is that of PX4's `simulator_mavlink`: HIL_SENSOR sets its clock, so times must only
grow; PX4 answers each message with HIL_ACTUATOR_CONTROLS once it controls the simulated UAV. The
simulation runs freely until the first answer, and always with a PX4 that has its own clock, such as
hardware. A group of sensors (accelerometer, gyroscope, magnetometer, barometer) is sent whole or
not at all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from volery.core.atmosphere import altitude as altitude_of
from volery.core.frames import frd_of_flu, ned_of_enu
from volery.mavlink.autopilot.vehicle import Vector
from volery.mavlink.codec import Codec, Parser, dialect
from volery.mavlink.framing import Framer

PERIOD_NS = 4_000_000
"""Period of PX4's simulations, 250 Hz."""
SIMULATOR = 51
"""Component id that PX4's own simulators use."""
ACCELEROMETER, GYROSCOPE, MAGNETOMETER, BAROMETER = 0x7, 0x38, 0x1C0, 0x1A00
"""Groups of HIL_SENSOR's `fields_updated`."""
_ARMED = 128
_GENERIC, _NO_AUTOPILOT = 0, 8
"""MAV_TYPE and MAV_AUTOPILOT of the simulator."""
_LOCK_STEP = 1
"""Flag of HIL_ACTUATOR_CONTROLS: PX4 was built to use the simulator's time."""
_GAUSS_A_TESLA = 1e4
_MAX_SPEED_CM_S = 32767


class Inertial(NamedTuple):
    """Sample of an IMU: specific force m/s^2 and rates rad/s, FLU."""

    force: Vector
    rates: Vector


class Fix(NamedTuple):
    """Fix of a GNSS receiver: degrees, degrees, m; m/s in the map."""

    latitude: float
    longitude: float
    altitude: float
    velocity: Vector
    horizontal_m: float
    vertical_m: float


class SensorValues(NamedTuple):
    """Measurements of an exchange; None: nothing new of that sensor."""

    inertial: Inertial
    field: Vector | None = None
    """Magnetic field, T, FLU."""
    pressure: float | None = None
    """Pressure, Pa."""
    temperature: float = 20.0
    """Air temperature, degrees Celsius."""
    fix: Fix | None = None


class Actuators(NamedTuple):
    """Outputs that PX4 requests."""

    controls: tuple[float, ...]
    """Outputs from -1 to 1, shape (16,)."""
    armed: bool
    time_ns: int = 0
    """Time of the sample that they follow from, if PX4 takes its time from the samples."""


class HilLink:
    """One vehicle's link to one PX4; `system` is PX4's system id."""

    def __init__(self, system: int) -> None:
        self._codec = Codec(system, SIMULATOR)
        self._framer, self._parser = Framer(), Parser()
        self._sequence = 0
        self.has_received = False
        """Whether any frame has arrived."""
        self.locked = False
        """Whether PX4 answers in lock step, so that the simulation waits for it."""

    def encode_exchange(self, time_ns: int, sensed: SensorValues) -> bytes:
        """Returns the frames of an exchange at a simulated time."""
        frames = self._sensor(time_ns // 1000, sensed)
        if sensed.fix is not None:
            frames += self._gps(time_ns // 1000, sensed.fix)
        return frames

    def heartbeat(self) -> bytes:
        """Returns a heartbeat of a simulator, which is not that of a ground station."""
        return self._pack(dialect().MAVLink_heartbeat_message(_GENERIC, _NO_AUTOPILOT, 0, 0, 0, 3))

    def feed(self, data: bytes) -> list[Actuators]:
        """Returns the actuator outputs in received bytes; other messages need no answer."""
        outputs = []
        for frame in self._framer.feed(data):
            self.has_received = True
            message = self._parser.decode(frame.data)
            if message is None or message.get_type() != "HIL_ACTUATOR_CONTROLS":
                continue
            self.locked = bool(message.flags & _LOCK_STEP)
            controls = tuple(
                min(max(part, -1.0), 1.0) if math.isfinite(part) else 0.0
                for part in message.controls
            )
            armed = bool(message.mode & _ARMED)
            outputs.append(Actuators(controls, armed, 1000 * message.time_usec))
        return outputs

    def _pack(self, message: object) -> bytes:
        self._sequence = (self._sequence + 1) % 256
        return self._codec.pack(message, self._sequence)

    def _sensor(self, time_us: int, sensed: SensorValues) -> bytes:
        fields = ACCELEROMETER | GYROSCOPE
        field = (0.0, 0.0, 0.0)
        if sensed.field is not None:
            fields |= MAGNETOMETER
            x, y, z = frd_of_flu(sensed.field)
            field = (x * _GAUSS_A_TESLA, y * _GAUSS_A_TESLA, z * _GAUSS_A_TESLA)
        hpa = height = 0.0
        if sensed.pressure is not None:
            fields |= BAROMETER
            hpa, height = sensed.pressure / 100.0, float(altitude_of(sensed.pressure))
        message = dialect().MAVLink_hil_sensor_message(
            time_us,
            *frd_of_flu(sensed.inertial.force),
            *frd_of_flu(sensed.inertial.rates),
            *field,
            hpa,
            0.0,
            height,
            sensed.temperature,
            fields,
            0,
        )
        return self._pack(message)

    def _gps(self, time_us: int, fix: Fix) -> bytes:
        seen = math.isfinite(fix.latitude)
        north, east, down = (
            min(max(round(100.0 * part), -_MAX_SPEED_CM_S), _MAX_SPEED_CM_S)
            for part in ned_of_enu(fix.velocity)
        )
        speed = round(math.hypot(north, east))
        course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
        position = (fix.latitude, fix.longitude, fix.altitude) if seen else (0.0, 0.0, 0.0)
        message = dialect().MAVLink_hil_gps_message(
            time_us,
            3 if seen else 0,
            round(position[0] * 1e7),
            round(position[1] * 1e7),
            round(position[2] * 1e3),
            min(round(100.0 * fix.horizontal_m), 65535) if seen else 65535,
            min(round(100.0 * fix.vertical_m), 65535) if seen else 65535,
            min(speed, 65534),
            north,
            east,
            down,
            course if speed > 30 else 65535,
            10 if seen else 0,
            0,
            0,
        )
        return self._pack(message)
