"""Logs the flights of one vehicle, as PX4 does: from arming to disarming by default.

The contents depend only on states of the vehicle and simulated time; logging does not affect the
flight.
"""

from __future__ import annotations

import struct

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.logs import ulog
from volery.mavlink.autopilot.logs.log_topics import TOPICS, LoggedTopic
from volery.mavlink.autopilot.messages.release import custom_version, flight_version, own_version
from volery.mavlink.autopilot.parameters import NAMES

DISABLED, UNTIL_DISARM, BOOT_UNTIL_DISARM, ALWAYS = -1, 0, 1, 2
"""Values of SDLOG_MODE."""
_RATES = tuple(
    (period_ns, tuple(topic for topic in TOPICS if topic.period_ns == period_ns))
    for period_ns in sorted({topic.period_ns for topic in TOPICS})
)
"""Topics that are sampled at the same times, by their period."""


class FlightLogger:
    """Starts and ends the logs of one vehicle, and samples its topics."""

    def __init__(self, context: AutopilotContext) -> None:
        self._context = context
        self._has_flown = False
        """Whether the vehicle has been disarmed since the start."""
        self._was_armed = False
        self._next_ns: list[int] = []

    def update(self) -> None:
        """Logs the newest state of the vehicle."""
        log = self._context.log
        if not self._is_wanted():
            log.end()
        elif not (log.is_recording or log.is_stopped):
            now_ns = self._context.memory.now_ns
            self._next_ns = [now_ns] * len(_RATES)
            log.begin(now_ns // 1_000_000_000, _beginning(self._context))
        if log.is_recording:
            self._sample()

    def _is_wanted(self) -> bool:
        mode, is_armed = self._context.parameter("SDLOG_MODE"), self._context.memory.armed
        self._has_flown |= self._was_armed and not is_armed
        self._was_armed = is_armed
        if mode == BOOT_UNTIL_DISARM and not self._has_flown:
            return True
        return mode == ALWAYS or (is_armed and mode != DISABLED)

    def _sample(self) -> None:
        now_ns, next_ns, samples = self._context.memory.now_ns, self._next_ns, b""
        for k, (period_ns, topics) in enumerate(_RATES):
            if now_ns < next_ns[k]:
                continue
            next_ns[k] = max(next_ns[k] + period_ns, now_ns - period_ns)
            samples += b"".join(_sample_of(self._context, topic) for topic in topics)
        if samples:
            self._context.log.append(samples)


def _sample_of(context: AutopilotContext, logged: LoggedTopic) -> bytes:
    values = logged.values(context)
    if values is None:
        return b""
    try:
        return logged.topic.sample(values)
    except (struct.error, OverflowError):  # a number that no float can represent
        return b""


def _beginning(context: AutopilotContext) -> bytes:
    """Returns header, definitions, and the numbers of the topics."""
    patch, minor, major = custom_version()[:3]
    return b"".join(
        (
            ulog.header(context.memory.now_ns // 1000),
            ulog.text_info("sys_name", "PX4"),
            ulog.text_info("ver_hw", "VOLERY_SITL"),
            ulog.text_info("ver_sw", f"Volery {own_version()}"),
            ulog.number_info("ver_sw_release", flight_version()),
            ulog.number_info("ver_vendor_sw_release", major << 24 | minor << 16 | patch << 8 | 255),
            ulog.text_info("sys_mcu", f"simulated {context.build.airframe}"),
            *(entry.topic.definition() for entry in TOPICS),
            *(ulog.parameter(name, context.parameter(name)) for name in NAMES),
            *(entry.topic.subscription() for entry in TOPICS),
        )
    )
