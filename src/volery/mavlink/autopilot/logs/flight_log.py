"""Holds the flight logs of one vehicle as ULog, and sends them to clients on request.

A log ends early if it fills its storage or the disk is full.
"""

from __future__ import annotations

from collections.abc import Callable

from volery.mavlink.autopilot.client_links import ClientLinks
from volery.mavlink.autopilot.logs import ulog
from volery.mavlink.autopilot.logs.log_storage import LogStorage
from volery.mavlink.autopilot.parameters import Value
from volery.mavlink.autopilot.protocols.log_transfer import LogTransfers


class FlightLog:
    """Appends to the current log. report: receives the reason of an early end."""

    def __init__(self, links: ClientLinks, report: Callable[[str], None]) -> None:
        self.storage = LogStorage()
        self.transfers = LogTransfers(links, self.storage)
        self.is_recording = False
        self.is_stopped = False
        """Whether the current log has ended before its flight."""
        self._report = report

    def begin(self, time_s: int, header: bytes) -> None:
        """Starts a log. time_s: simulated time."""
        try:
            self.storage.begin(time_s)
        except OSError as error:
            self._give_up(str(error.strerror))
            return
        self.is_recording = True
        self.append(header)

    def append(self, data: bytes) -> None:
        """Appends records to the current log."""
        try:
            has_room = self.storage.append(data)
        except OSError as error:
            self._give_up(str(error.strerror))
            return
        if not has_room:
            self.is_recording, self.is_stopped = False, True
            self._report("Flight log is full: logging ends")

    def note(self, now_ns: int, severity: int, text: str) -> None:
        """Logs a text that the vehicle sends."""
        if self.is_recording:
            self.append(ulog.logged_text(severity, now_ns // 1000, text))

    def note_parameter(self, name: str, value: Value) -> None:
        """Logs a parameter that has changed."""
        if self.is_recording:
            self.append(ulog.parameter(name, value))

    def end(self) -> None:
        """Ends the current log; the next state may start another one."""
        self.is_recording = self.is_stopped = False

    def close(self) -> None:
        """Ends and deletes all logs."""
        self.end()
        self.transfers.clear()
        self.storage.close()

    def _give_up(self, why: str) -> None:
        self.storage.close()
        self.is_recording, self.is_stopped = False, True
        self._report(f"Flight log cannot be written: {why}")
