"""A simulated UAV for a real PX4: sensors out, rotors in, in lock step.

The protocol is that of PX4's `simulator_mavlink`: HIL_SENSOR sets its clock, so that times must
only grow; it answers each with HIL_ACTUATOR_CONTROLS once it has begun to fly the simulation. Until
the first answer the simulation runs freely, and beside a PX4 with a clock of its own, such as
hardware, always. A group of sensors (accelerometer, gyroscope,
magnetometer, barometer) is told whole or not at all.
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
"""PX4's simulations run at 250 Hz."""
SIMULATOR = 51
"""Component id that PX4's own simulators use."""
ACCELEROMETER, GYROSCOPE, MAGNETOMETER, BAROMETER = 0x7, 0x38, 0x1C0, 0x1A00
"""Groups of HIL_SENSOR's `fields_updated`."""
_ARMED = 128
_GENERIC, _NO_AUTOPILOT = 0, 8
"""MAV_TYPE and MAV_AUTOPILOT of the simulator."""
_LOCK_STEP = 1
"""Of HIL_ACTUATOR_CONTROLS: PX4 was built to take its time from the simulator."""
_GAUSS_A_TESLA = 1e4
_MOST_CM_S = 32767


class Inertial(NamedTuple):
    """Of an IMU: specific force m/s^2 and rates rad/s, FLU."""

    force: Vector
    rates: Vector


class Fix(NamedTuple):
    """Of a GNSS receiver: degrees, degrees, m; m/s in the map."""

    latitude: float
    longitude: float
    altitude: float
    velocity: Vector
    horizontal_m: float
    vertical_m: float


class SensorValues(NamedTuple):
    """What was measured for a meeting; None: nothing new of that sensor."""

    inertial: Inertial
    field: Vector | None = None
    """T, FLU."""
    pressure: float | None = None
    """Pa."""
    temperature: float = 20.0
    """degrees Celsius."""
    fix: Fix | None = None


class Actuators(NamedTuple):
    """What PX4 wants of its outputs."""

    controls: tuple[float, ...]
    """(16,) from -1 to 1."""
    armed: bool
    time_ns: int = 0
    """Of the reading that they follow from, where PX4 takes its time from the readings."""


class HilLink:
    """One vehicle's connection to one PX4; `system` is the id that PX4 will have."""

    def __init__(self, system: int) -> None:
        self._codec = Codec(system, SIMULATOR)
        self._framer, self._parser = Framer(), Parser()
        self._sequence = 0
        self.spoken = False
        """Whether any frame has come."""
        self.locked = False
        """Whether PX4 has begun to answer in lock step, and is to be waited for from now on."""

    def tell(self, time_ns: int, sensed: SensorValues) -> bytes:
        """Frames for a meeting at a simulated time."""
        frames = self._sensor(time_ns // 1000, sensed)
        if sensed.fix is not None:
            frames += self._gps(time_ns // 1000, sensed.fix)
        return frames

    def heartbeat(self) -> bytes:
        """A frame that says that a simulator is there, as nobody's ground station."""
        return self._pack(dialect().MAVLink_heartbeat_message(_GENERIC, _NO_AUTOPILOT, 0, 0, 0, 3))

    def feed(self, data: bytes) -> list[Actuators]:
        """Answers in what PX4 sent; its other messages need none."""
        answers = []
        for frame in self._framer.feed(data):
            self.spoken = True
            message = self._parser.decode(frame.data)
            if message is None or message.get_type() != "HIL_ACTUATOR_CONTROLS":
                continue
            self.locked = bool(message.flags & _LOCK_STEP)
            controls = tuple(
                min(max(part, -1.0), 1.0) if math.isfinite(part) else 0.0
                for part in message.controls
            )
            armed = bool(message.mode & _ARMED)
            answers.append(Actuators(controls, armed, 1000 * message.time_usec))
        return answers

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
            min(max(round(100.0 * part), -_MOST_CM_S), _MOST_CM_S)
            for part in ned_of_enu(fix.velocity)
        )
        speed = round(math.hypot(north, east))
        course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
        place = (fix.latitude, fix.longitude, fix.altitude) if seen else (0.0, 0.0, 0.0)
        message = dialect().MAVLink_hil_gps_message(
            time_us,
            3 if seen else 0,
            round(place[0] * 1e7),
            round(place[1] * 1e7),
            round(place[2] * 1e3),
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
