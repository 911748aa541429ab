"""A client that keeps to ArduPilot's rules of lock step, and fails where the simulator breaks them.

It sends one frame of outputs, waits for the state, reads it as ArduPilot's reader does, which knows
no JSON, and checks order, spacing and units; the outputs are a climb, in which a real one would
steer.
"""

from __future__ import annotations

import math
import re
import socket
import struct
import threading

STEP_S = 0.00125
KEYS = {
    ("", "timestamp"): 1,
    ("imu", "gyro"): 3,
    ("imu", "accel_body"): 3,
    ("", "position"): 3,
    ("", "quaternion"): 4,
    ("", "velocity"): 3,
    ("battery", "voltage"): 1,
}
NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def read(line, section, key, count):
    """What ArduPilot finds of a key: by substring, two characters behind it."""
    at = line.find(section)
    if at < 0:
        assert section == "battery", f"no section {section}"
        return None
    at = line.find(key, at + len(section) + 1)
    if at < 0:
        return None
    at += len(key) + 2
    assert line[at] != " ", "its reader takes no blank after a colon"
    numbers = []
    for _ in range(count):
        if count > 1:
            at = re.compile(r"[-\d]").search(line, at).start()
        found = NUMBER.match(line, at)
        assert found, f"no number for {key}: {line[at : at + 20]}"
        numbers.append(float(found.group()))
        at = found.end()
    return numbers


class ArdupilotStandIn(threading.Thread):
    """Sends `frames` frames, from the `arm_at`-th on with `pwm` on four motors."""

    def __init__(self, port, frames, *, pwm=1000, arm_at=0, first=0, magic=18458, may_jump=False):
        super().__init__(daemon=True)
        self.frames, self.pwm, self.arm_at, self.first = frames, pwm, arm_at, first
        self.magic, self.outputs = magic, 16 if magic == 18458 else 32
        self.may_jump, self.jumps = may_jump, 0
        self.states, self.resent = [], 0
        self.fault = None
        self.done = threading.Event()
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))
        self.link.settimeout(1.0)

    def run(self):
        try:
            for number in range(self.first, self.first + self.frames):
                self.send(number)
                self._check(self._state(number))
            self.send(self.first + self.frames)  # so that the last state was answered
        except Exception as fault:
            self.fault = fault
        finally:
            self.link.close()
            self.done.set()

    def send(self, number):
        pwm = self.pwm if number - self.first >= self.arm_at else 1000
        outputs = [pwm] * 4 + [0] * (self.outputs - 4)
        self.link.send(struct.pack(f"<HHI{self.outputs}H", self.magic, 1200, number, *outputs))

    def _state(self, number):
        for _ in range(60):
            try:
                return self.link.recv(65000)
            except (TimeoutError, ConnectionRefusedError):
                self.resent += 1
                self.send(number)
        raise AssertionError("no state came")

    def _check(self, data):
        assert data[:1] == data[-1:] == b"\n"
        line = data[1:-1].decode("ascii")
        assert "\n" not in line
        state = {key: read(line, *key, count) for key, count in KEYS.items()}
        time_s = state["", "timestamp"][0]
        before_s = self.states[-1]["", "timestamp"][0] if self.states else 0.0
        if self.may_jump and time_s < before_s:  # it says "Detected physics reset" and goes on
            self.jumps, before_s = self.jumps + 1, 0.0
        assert math.isclose(time_s - before_s, STEP_S, abs_tol=1e-8), "a step is missing"
        assert math.isclose(math.hypot(*state["", "quaternion"]), 1.0, abs_tol=1e-6)
        assert math.hypot(*state["imu", "gyro"]) < 5.0
        assert math.hypot(*state["imu", "accel_body"]) < 200.0  # it falls to its feet at first
        self.states.append(state)
