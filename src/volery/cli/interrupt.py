"""Ctrl-C: at once before a flight, between two steps in flight, at once if pressed again."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType
from typing import Any

_COMPILER = "llvmlite."
_RETRY_S = 0.01


class Interrupts:
    """Context in which SIGINT is handled; `pressed` says whether it has come."""

    def __init__(self) -> None:
        self.pressed = False
        self.gentle = False
        self._raised = False
        self._retry: threading.Timer | None = None
        self._handler: Any = None
        self._hook: Any = None

    def __enter__(self) -> Interrupts:
        """Take SIGINT over; it raises KeyboardInterrupt until `be_gentle`."""
        self._handler = signal.signal(signal.SIGINT, self._on_signal)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        return self

    def __exit__(self, *_exception: object) -> None:
        """Give SIGINT back.

        After a KeyboardInterrupt the hook stays: the process ends, and what the interrupt left half
        made may live for as long.
        """
        self._forget_retry()
        signal.signal(signal.SIGINT, self._handler)
        if not self._raised:
            sys.unraisablehook = self._hook

    def be_gentle(self) -> None:
        """Let the first SIGINT from here on only set `pressed`; KeyboardInterrupt if one was lost.

        One is lost where it comes in a callback of the garbage collector, which can pass no
        exception on.
        """
        self._forget_retry()
        if self.pressed:
            raise KeyboardInterrupt
        self.gentle = True

    def _on_signal(self, _signal: int, frame: FrameType | None) -> None:
        at_once = self.pressed or not self.gentle
        self.pressed = True
        if not at_once:
            return
        self._forget_retry()
        if _is_compiling(frame):
            self._retry = threading.Timer(_RETRY_S, _thread.interrupt_main)
            self._retry.daemon = True
            self._retry.start()
        else:
            self._raised = True
            raise KeyboardInterrupt

    def _forget_retry(self) -> None:
        if self._retry is not None:
            self._retry.cancel()
            self._retry = None

    def _on_unraisable(self, unraisable: Any) -> None:
        """Say nothing of lost interrupts, and of objects that one left half made."""
        if not (self._raised or issubclass(unraisable.exc_type, KeyboardInterrupt)):
            self._hook(unraisable)


def _is_compiling(frame: FrameType | None) -> bool:
    """Whether the compiler's own code runs: its callbacks lose exceptions, and it fails on them."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith(_COMPILER):
            return True
        frame = frame.f_back
    return False
