"""Logs the flights of one vehicle as ULog, as PX4 does: from arming to disarming by default.

The contents depend only on states of the vehicle and simulated time; logging does not affect the
flight. A log ends early if it fills its storage or the disk is full.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from volery.mavlink.autopilot import ulog
from volery.mavlink.autopilot.log_storage import LogStorage
from volery.mavlink.autopilot.log_topics import TOPICS, LoggedTopic
from volery.mavlink.autopilot.log_transfer import LogTransfers
from volery.mavlink.autopilot.parameters import NAMES
from volery.mavlink.autopilot.release import custom_version, flight_version, own_version

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot

DISABLED, UNTIL_DISARM, BOOT_UNTIL_DISARM, ALWAYS = -1, 0, 1, 2
"""Values of SDLOG_MODE."""
_RATES = tuple(
    (period_ns, tuple(topic for topic in TOPICS if topic.period_ns == period_ns))
    for period_ns in sorted({topic.period_ns for topic in TOPICS})
)
"""Topics that are sampled at the same times, by their period."""


class FlightLog:
    """Records the logs of one vehicle, and sends them to clients on request."""

    def __init__(self, storage: LogStorage | None = None) -> None:
        self.storage = storage or LogStorage()
        self.transfers = LogTransfers()
        self.is_recording = False
        self._is_stopped = False
        """Whether the current log has ended before its flight."""
        self._has_flown = False
        """Whether the vehicle has been disarmed since the start."""
        self._was_armed = False
        self._next_ns: list[int] = []

    def update(self, autopilot: Autopilot) -> None:
        """Logs the newest state of the vehicle."""
        is_wanted = self._is_wanted(autopilot)
        if not is_wanted:
            self.end()
        elif not (self.is_recording or self._is_stopped):
            self._begin(autopilot)
        if self.is_recording:
            self._sample(autopilot)

    def note(self, autopilot: Autopilot, severity: int, text: str) -> None:
        """Logs a text that the vehicle sends."""
        if self.is_recording:
            self._append(
                autopilot, ulog.logged_text(severity, autopilot.memory.now_ns // 1000, text)
            )

    def note_parameter(self, autopilot: Autopilot, name: str) -> None:
        """Logs a parameter that has changed."""
        if self.is_recording:
            self._append(autopilot, ulog.parameter(name, autopilot.parameter(name)))

    def end(self) -> None:
        """Ends the current log; the next state may start another one."""
        self.is_recording = self._is_stopped = False

    def close(self) -> None:
        """Ends and deletes all logs."""
        self.end()
        self.transfers.clear()
        self.storage.close()

    def _is_wanted(self, autopilot: Autopilot) -> bool:
        mode, is_armed = autopilot.parameter("SDLOG_MODE"), autopilot.memory.armed
        self._has_flown |= self._was_armed and not is_armed
        self._was_armed = is_armed
        if mode == BOOT_UNTIL_DISARM and not self._has_flown:
            return True
        return mode == ALWAYS or (is_armed and mode != DISABLED)

    def _begin(self, autopilot: Autopilot) -> None:
        now_ns = autopilot.memory.now_ns
        self._next_ns = [now_ns] * len(_RATES)
        try:
            self.storage.begin(now_ns // 1_000_000_000)
        except OSError as error:
            self._give_up(autopilot, str(error.strerror))
            return
        self.is_recording = True
        self._append(autopilot, _beginning(autopilot))

    def _sample(self, autopilot: Autopilot) -> None:
        now_ns, next_ns, samples = autopilot.memory.now_ns, self._next_ns, b""
        for k, (period_ns, topics) in enumerate(_RATES):
            if now_ns < next_ns[k]:
                continue
            next_ns[k] = max(next_ns[k] + period_ns, now_ns - period_ns)
            samples += b"".join(_sample_of(autopilot, topic) for topic in topics)
        if samples:
            self._append(autopilot, samples)

    def _append(self, autopilot: Autopilot, data: bytes) -> None:
        try:
            has_room = self.storage.append(data)
        except OSError as error:
            self._give_up(autopilot, str(error.strerror))
            return
        if not has_room:
            self.is_recording, self._is_stopped = False, True
            autopilot.say(4, "Flight log is full: logging ends")

    def _give_up(self, autopilot: Autopilot, why: str) -> None:
        self.storage.close()
        self.is_recording, self._is_stopped = False, True
        autopilot.say(4, f"Flight log cannot be written: {why}")


def _sample_of(autopilot: Autopilot, logged: LoggedTopic) -> bytes:
    values = logged.values(autopilot)
    if values is None:
        return b""
    try:
        return logged.topic.sample(values)
    except (struct.error, OverflowError):  # a number that no float can represent
        return b""


def _beginning(autopilot: Autopilot) -> bytes:
    """Returns header, definitions, and the numbers of the topics."""
    patch, minor, major = custom_version()[:3]
    return b"".join(
        (
            ulog.header(autopilot.memory.now_ns // 1000),
            ulog.text_info("sys_name", "PX4"),
            ulog.text_info("ver_hw", "VOLERY_SITL"),
            ulog.text_info("ver_sw", f"Volery {own_version()}"),
            ulog.number_info("ver_sw_release", flight_version()),
            ulog.number_info("ver_vendor_sw_release", major << 24 | minor << 16 | patch << 8 | 255),
            ulog.text_info("sys_mcu", f"simulated {autopilot.build.airframe}"),
            *(entry.topic.definition() for entry in TOPICS),
            *(ulog.parameter(name, autopilot.parameter(name)) for name in NAMES),
            *(entry.topic.subscription() for entry in TOPICS),
        )
    )
