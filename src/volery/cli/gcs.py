"""`volery gcs`: runs a ground station at the terminal, or with lines from another program."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
import time
from pathlib import Path
from typing import BinaryIO

from volery.cli.error_reporting import warn
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line, echo_lines
from volery.comms.addresses import Identity
from volery.comms.control_payloads import Refusal
from volery.comms.protocol import StationFrame
from volery.comms.server.tcp import PORT
from volery.comms.station.core import FATAL
from volery.comms.station.ground_station import HEAD, HELP, GroundStation
from volery.comms.station.tcp import Station
from volery.core.errors import CommsError, reason_of
from volery.core.plain_text import plain
from volery.core.wall_time import steady_time_ns
from volery.core.whole_files import open_to_append

_LEAVE_S = 2.0
"""Wall time for commands in transit after the last input line."""
_FIRST_S, _OTHERS_S = 2.0, 0.3
"""Wall times for which a script waits for the first state of a UAV, then for those of others."""


def parse_server(text: str) -> tuple[str, int]:
    """Parses HOST[:PORT]. Raises `CommsError` for other texts."""
    host, colon, port = text.rpartition(":")
    if not colon or host.endswith(":"):
        return text, PORT  # a name, or an IPv6 address
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise CommsError(f"'{text}' is not a server address; use HOST:PORT")
    return host.strip("[]"), int(port)


def command_station(
    server: str, number: int, token: str | None, group_size: int, log: Path | None
) -> None:
    """Joins a server, prints received messages and sends the commands of the input lines."""
    host, port = parse_server(server)
    with contextlib.ExitStack() as stack:
        file = None if log is None else stack.enter_context(open_to_append(log))
        desk = _Desk(file)
        station = Station(
            Identity.ground(number),
            desk.on_message,
            desk.on_refusal,
            on_joined=desk.on_joined,
            host=host,
            port=port,
            name="gcs",
            token=token,
            group_size=group_size,
        )
        desk.ground = GroundStation(station.send, group_size, lambda: station.joined)
        asyncio.run(desk.work(station))


class _Desk:
    """Reads input lines and prints messages.

    log: file to which all lines are appended, with UTC times.
    """

    ground: GroundStation

    def __init__(self, log: BinaryIO | None) -> None:
        self._log = log
        self._has_joined = False
        self._is_sent_away = False
        self._lines: asyncio.Queue[str | None] = asyncio.Queue()

    async def work(self, station: Station) -> None:
        """Works until the last line or `quit`.

        Raises `CommsError` if the server rejects this station.
        """
        await station.start()
        self._print(
            f"joined as ground station, address {station.core.address}; help shows commands"
        )
        self._has_joined = True
        lines = self._lines
        _read_into(lines, asyncio.get_running_loop())
        waits = not sys.stdin.isatty()
        try:
            while (line := await lines.get()) is not None and line.strip() not in ("quit", "exit"):
                if waits and line.strip() != "help":
                    await self._wait_for_states()
                    waits = False
                self._do(line)
            if station.joined:
                with contextlib.suppress(TimeoutError, asyncio.TimeoutError):
                    await asyncio.wait_for(station.until_settled(), _LEAVE_S)
            if still_open := self.ground.open_commands(station.core.is_settled):
                self._print(f"warning: no acknowledgement of: {', '.join(still_open)}")
        finally:
            await station.stop()
        if station.core.fatal is not None:
            raise CommsError(f"the server rejects this station: {station.core.fatal.text}")

    async def _wait_for_states(self) -> None:
        ends = time.monotonic() + _FIRST_S
        while not self.ground.has_received and time.monotonic() < ends:
            await asyncio.sleep(0.02)
        if self.ground.has_received:
            await asyncio.sleep(_OTHERS_S)

    def _do(self, line: str) -> None:
        command = line.strip()
        if not command:
            return
        if command == "help":
            echo_lines(HELP)
        elif command == "list":
            print_table(HEAD, self.ground.rows(steady_time_ns()), right=(4, 5, 6))
            if not self.ground.has_received:
                echo_line("no message of a UAV received so far")
            sys.stdout.flush()
        else:
            try:
                self._print(self.ground.command(command))
            except CommsError as error:
                self._print(f"error: {error}")

    def on_message(self, frame: StationFrame) -> None:
        """Prints a received message."""
        if line := self.ground.take(frame, steady_time_ns()):
            self._print(line)

    def on_refusal(self, refusal: Refusal) -> None:
        """Prints a refusal of the server; ends the command if the server rejects this station."""
        if refusal.sequence or refusal.reason not in FATAL:
            self._print(self.ground.refused(refusal))
        else:
            self._is_sent_away = True
            self._lines.put_nowait(None)

    def on_joined(self, joined: bool) -> None:
        """Prints that the server connected or disconnected."""
        if joined and self._has_joined:
            self._print("the server is back")
        elif not joined and not self._is_sent_away:
            self._print("the connection to the server is lost; trying again")

    def _print(self, line: str) -> None:
        line = plain(line)
        echo_line(line)
        sys.stdout.flush()
        self._write(line)

    def _write(self, line: str) -> None:
        """Appends a line to the log; a full disk ends the log, not the station."""
        if self._log is None:
            return
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime())
        try:
            self._log.write(f"{stamp}Z {line}\n".encode())
            self._log.flush()
        except OSError as error:
            with contextlib.suppress(OSError):  # what is buffered cannot be written either
                self._log.close()
            self._log = None
            warn(f"the log ends here: {reason_of(error)}")


def _read_into(queue: asyncio.Queue[str | None], loop: asyncio.AbstractEventLoop) -> None:
    """Queues lines of standard input, then None; reads them in a thread, because reads block."""

    def read() -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            for line in sys.stdin:
                loop.call_soon_threadsafe(queue.put_nowait, line)
            loop.call_soon_threadsafe(queue.put_nowait, None)

    threading.Thread(target=read, name="volery-lines", daemon=True).start()
