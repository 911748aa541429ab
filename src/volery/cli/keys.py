"""Reads keys pressed at a terminal without waiting for Enter."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
from typing import Any

_ESCAPE = "\x1b"
_LOCAL_FLAGS, _CONTROL = 3, 6
"""Indices in the list of terminal attributes of termios."""


class Keys:
    """Context in which single keys can be read; there are none if stdin is no terminal.

    Ctrl-C and Ctrl-Z work as usual. In the background the terminal is left unchanged, because the
    system stops background processes that change it.
    """

    def __init__(self) -> None:
        self._terminal = -1
        self._before: list[Any] = []

    def __enter__(self) -> Keys:
        """Saves the terminal's settings."""
        stdin = sys.stdin
        if stdin is not None and not stdin.closed and stdin.isatty():
            self._terminal = stdin.fileno()
            self._before = termios.tcgetattr(self._terminal)
        return self

    def __exit__(self, *_exception: object) -> None:
        """Restores the terminal's settings."""
        if self._terminal >= 0 and self._in_foreground():
            with contextlib.suppress(termios.error):  # hung up
                termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)

    def pressed(self) -> str:
        """Returns the keys since the last call, one character each.

        Leaves out cursor keys and other escape sequences.
        """
        if self._terminal < 0 or not self._in_foreground():
            return ""
        try:
            self._read_single_keys()
            if not select.select([self._terminal], [], [], 0.0)[0]:
                return ""
            data = os.read(self._terminal, 64)
        except (OSError, termios.error):
            data = b""
        if not data:
            self._terminal = -1  # hung up
        return data.decode(errors="ignore").partition(_ESCAPE)[0]

    def _read_single_keys(self) -> None:
        """Turns line buffering and echo off, again if a shell has turned them on meanwhile."""
        mode: list[Any] = termios.tcgetattr(self._terminal)
        cleared = termios.ICANON | termios.ECHO
        if mode[_LOCAL_FLAGS] & cleared:
            mode[_LOCAL_FLAGS] &= ~cleared
            mode[_CONTROL][termios.VMIN], mode[_CONTROL][termios.VTIME] = 1, 0
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, mode)

    def _in_foreground(self) -> bool:
        try:
            return os.tcgetpgrp(self._terminal) == os.getpgrp()
        except OSError:
            return True  # not our controlling terminal: it has no background
