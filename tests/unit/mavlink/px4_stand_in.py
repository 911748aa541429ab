"""A client that keeps to PX4's rules of lock step, and fails where the simulator breaks them.

It blocks for each HIL_SENSOR, checks order, spacing, groups and units, and answers each with one
HIL_ACTUATOR_CONTROLS: a climb at a fixed throttle, in which a real PX4 would steer.
"""

from __future__ import annotations

import math
import os
import select
import socket
import threading
import tty

from volery.mavlink.codec import Codec, dialect
from volery.mavlink.framing import Framer

PERIOD_US = 4000
WHOLE_GROUPS = (0x7, 0x38, 0x1C0, 0x1A00, 0x400)


def connect(port):
    """Over TCP, as PX4 does."""
    link = socket.create_connection(("127.0.0.1", port), timeout=60.0)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


class Terminal:
    """The far end of a pseudo-terminal, as a connection; `path` is the near end."""

    def __init__(self):
        self._file, self._near = os.openpty()
        self._closing = False
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)

    def sendall(self, data):
        while data:
            data = data[os.write(self._file, data) :]

    def recv(self, size):
        while not self._closing:
            ready, _, _ = select.select([self._file], [], [], 0.1)
            if ready:
                return os.read(self._file, size)
        for file in (self._file, self._near):
            os.close(file)
        return b""

    def close(self):
        """End the present or next `recv`, and the line with it."""
        self._closing = True


class StandIn(threading.Thread):
    """Connects at once; responds `num_responses` times with `throttle`, armed from `arm_at` on.

    With `dozes` it then receives so many samples without a word, and responds as often again.
    """

    def __init__(
        self,
        port,
        num_responses,
        *,
        throttle=0.0,
        arm_at=0,
        falls_silent=False,
        dozes=0,
        in_lock_step=True,
        link=None,
    ):
        super().__init__(daemon=True)
        self.port, self.num_responses = port, num_responses
        self.throttle, self.arm_at = throttle, arm_at
        self.falls_silent, self.in_lock_step = falls_silent, in_lock_step
        self.dozes = dozes
        self.fault = None
        self.sensors, self.fixes, self.groups = [], [], 0
        self.done = threading.Event()
        self._link = connect(port) if link is None else link
        self._codec, self._framer = Codec(1, 1), Framer()
        self._mav = dialect().MAVLink(None, 0, 0)
        self._messages = []
        make = dialect()
        interval = make.MAVLink_command_long_message(0, 0, 511, 0, 115.0, 5000.0, 0, 0, 0, 0, 0)
        for message in (make.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3), interval):
            self._link.sendall(self._codec.pack(message, 0))

    def run(self):
        try:
            self._fly(self.num_responses)
            if self.dozes:
                for _ in range(self.dozes):
                    self._check(self._next_sensor())
                self._fly(self.num_responses)
            if not self.falls_silent:
                self._link.close()
        except Exception as fault:
            self.fault = fault
            self._link.close()
        finally:
            self.done.set()

    def close(self):
        self._link.close()

    def _fly(self, num_responses):
        for number in range(num_responses):
            self._check(self._next_sensor())
            self._respond(number)

    def _next_sensor(self):
        while True:
            while not self._messages:
                data = self._link.recv(65536)
                assert data, "the simulator closed the connection"
                self._messages += [
                    self._mav.decode(bytearray(f.data)) for f in self._framer.feed(data)
                ]
            message = self._messages.pop(0)
            if message.get_type() == "HIL_SENSOR":
                return message
            if message.get_type() == "HEARTBEAT":
                continue
            assert message.get_type() == "HIL_GPS", message
            self._check_fix(message)

    def _check(self, sensor):
        if self.in_lock_step and len(self.sensors) > 1:  # before the first response it runs freely
            assert sensor.time_usec - self.sensors[-1].time_usec == PERIOD_US, "a step is missing"
        fields = sensor.fields_updated
        for group in WHOLE_GROUPS:
            assert fields & group in (0, group), f"half a group: {fields:#x}"
        assert fields & 0x3F == 0x3F, "no accelerometer or gyroscope"
        self.groups |= fields
        parts = (sensor.xacc, sensor.yacc, sensor.zacc, sensor.xgyro, sensor.ygyro, sensor.zgyro)
        assert all(map(math.isfinite, parts))
        if fields & 0x1C0:
            assert 0.2 < math.hypot(sensor.xmag, sensor.ymag, sensor.zmag) < 0.7, "gauss"
        if fields & 0x1A00:
            assert 900.0 < sensor.abs_pressure < 1013.0, "hPa"
            assert abs(sensor.pressure_alt - 488.0) < 60.0, "m above the sea"
            assert -10.0 < sensor.temperature < 45.0, "degrees Celsius"
        self.sensors.append(sensor)

    def _check_fix(self, fix):
        assert fix.fix_type == 3
        assert abs(fix.lat - 473977420) < 2000
        assert abs(fix.alt - 488_000) < 60_000
        assert fix.cog == 65535 or fix.cog < 36000
        self.fixes.append(fix)

    def _respond(self, number):
        armed = number >= self.arm_at
        controls = [self.throttle if armed else 0.0] * 4 + [0.0] * 12
        time_us = self.sensors[-1].time_usec
        message = dialect().MAVLink_hil_actuator_controls_message(
            time_us, controls, 128 if armed else 0, int(self.in_lock_step)
        )
        self._link.sendall(self._codec.pack(message, number % 256))
