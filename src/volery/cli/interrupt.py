"""Ctrl-C: at once before a flight, between two steps in flight, at once if pressed again."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any


class Interrupts:
    """Context in which SIGINT is handled; `pressed` says whether it has come."""

    def __init__(self) -> None:
        self.pressed = False
        self.gentle = False
        self._handler: Any = None
        self._hook: Any = None

    def __enter__(self) -> Interrupts:
        """Take SIGINT over; it raises KeyboardInterrupt until `be_gentle`."""
        self._handler = signal.signal(signal.SIGINT, self._on_signal)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        return self

    def __exit__(self, *_exception: object) -> None:
        """Give SIGINT back."""
        signal.signal(signal.SIGINT, self._handler)
        sys.unraisablehook = self._hook

    def be_gentle(self) -> None:
        """Let the first SIGINT from here on only set `pressed`; KeyboardInterrupt if one was lost.

        One is lost where it comes in a callback of a compiler or of the garbage collector, which
        can pass no exception on.
        """
        if self.pressed:
            raise KeyboardInterrupt
        self.gentle = True

    def _on_signal(self, _signal: int, _frame: FrameType | None) -> None:
        at_once = self.pressed or not self.gentle
        self.pressed = True
        if at_once:
            raise KeyboardInterrupt

    def _on_unraisable(self, unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            self._hook(unraisable)
