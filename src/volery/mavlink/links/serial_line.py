"""Reads and writes a raw serial line in the loop of a bridge."""

from __future__ import annotations

import asyncio
import contextlib
import os
import termios
import tty
from collections.abc import Callable

from volery.core.errors import BridgeError

_MAX_UNSENT_BYTES = 1 << 14
"""Largest number of unsent bytes; frames beyond are dropped, as PX4 does."""


class SerialLine:
    """Opens `path` at `baud` and calls `take` with received bytes.

    Raises `BridgeError` if that fails.
    """

    def __init__(self, path: str, baud: int, take: Callable[[bytes], None]) -> None:
        self._take = take
        self._unsent = bytearray()
        self._loop = asyncio.get_running_loop()
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise BridgeError(f"{path}: {baud} baud is not a supported speed")
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise BridgeError(f"{path}: {error.strerror}") from None
        try:
            tty.setraw(self._file)
            settings = termios.tcgetattr(self._file)
            settings[4] = settings[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, settings)
        except termios.error as error:
            os.close(self._file)
            raise BridgeError(f"{path} is not a serial line: {error.args[-1]}") from None
        self.number = self._file
        """Differs from that of any other open line."""
        self._loop.add_reader(self._file, self._read)

    def send(self, data: bytes) -> None:
        """Sends frames; drops them if the line is too slow."""
        if len(self._unsent) + len(data) <= _MAX_UNSENT_BYTES:
            self._unsent += data
            self._write()

    def close(self) -> None:
        """Closes the line; further calls do nothing."""
        if self._file >= 0:
            self._loop.remove_reader(self._file)
            self._loop.remove_writer(self._file)
            os.close(self._file)
            self._file = -1

    def _read(self) -> None:
        try:
            data = os.read(self._file, 65536)
        except BlockingIOError:
            return
        except OSError:  # the other side of a pseudo-terminal has closed
            data = b""
        if data:
            self._take(data)
        else:
            self._loop.remove_reader(self._file)

    def _write(self) -> None:
        written = 0
        with contextlib.suppress(BlockingIOError, OSError):
            written = os.write(self._file, self._unsent)
        del self._unsent[:written]
        if self._unsent:
            self._loop.add_writer(self._file, self._write)
        else:
            self._loop.remove_writer(self._file)
