"""Ctrl-C, SIGTERM and SIGHUP: at once before a flight, between two steps in flight.

All three end a command in the same way: a terminal's Ctrl-C, the stop of a container or a service,
a terminal that is closed. The second one ends it without further files; after that SIGTERM and
SIGHUP do what they do to any process.
"""

from __future__ import annotations

import _thread
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, ClassVar

_COMPILER = "llvmlite."
_RETRY_S = 0.01
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CAUSES = {
    signal.SIGINT: "with Ctrl-C",
    signal.SIGTERM: "by SIGTERM",
    signal.SIGHUP: "by SIGHUP: its terminal has closed",
}
_FATAL = 128
"""What shells add to the number of the signal that ended a process."""


class StopSignals:
    """Context in which the three signals call `on_signal`; SIGHUP only where it is not ignored.

    Does nothing outside of the main thread, which alone can take signals.
    """

    first: ClassVar[signal.Signals | None] = None
    """The signal that came first to the present command."""

    def __init__(
        self,
        on_signal: Callable[[int, FrameType | None], None],
        signals: tuple[signal.Signals, ...] = _SIGNALS,
    ) -> None:
        self._on_signal = on_signal
        self._signals = signals
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> StopSignals:
        """Take the signals over."""
        if threading.current_thread() is threading.main_thread():
            for number in self._signals:
                if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                    continue  # `nohup`
                self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_exception: object) -> None:
        """Give the signals back."""
        for number, handler in self._before.items():
            if signal.getsignal(number) == self._take:
                signal.signal(number, handler)

    def leave_to_the_system(self) -> None:
        """Have the next SIGTERM or SIGHUP end the process whatever it does."""
        for number in self._before:
            if number is not signal.SIGINT:
                signal.signal(number, signal.SIG_DFL)

    def _take(self, number: int, frame: FrameType | None) -> None:
        StopSignals.first = StopSignals.first or signal.Signals(number)
        if number == signal.SIGHUP:
            _write_nowhere()
        self._on_signal(number, frame)


def stopped_how() -> str:
    """Returns how the process was stopped, for people: `with Ctrl-C`."""
    return _CAUSES[StopSignals.first or signal.SIGINT]


def stopped_code() -> int:
    """Returns the exit code after a signal: 130, 143 or 129, as shells have it."""
    return _FATAL + (StopSignals.first or signal.SIGINT)


def stop_at_once(_number: int, _frame: FrameType | None) -> None:
    """End a command that has nothing to write: raises `KeyboardInterrupt`."""
    raise KeyboardInterrupt


class Interrupts:
    """Context in which the signals are handled; `pressed` says whether one has come."""

    def __init__(self) -> None:
        self.pressed = False
        self.gentle = False
        self._raised = False
        self._retry: threading.Timer | None = None
        self._signals = StopSignals(self._on_signal)
        self._hook: Any = None

    def __enter__(self) -> Interrupts:
        """Take the signals over; they raise KeyboardInterrupt until `be_gentle`."""
        self._signals.__enter__()
        self._hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        return self

    def __exit__(self, *_exception: object) -> None:
        """Give the signals back.

        After a KeyboardInterrupt the hook stays: the process ends, and what the interrupt left half
        made may live for as long.
        """
        self._forget_retry()
        self._signals.__exit__()
        if not self._raised:
            sys.unraisablehook = self._hook

    def be_gentle(self) -> None:
        """Let the first signal from here on only set `pressed`; KeyboardInterrupt if one was lost.

        One is lost where it comes in a callback of the garbage collector, which can pass no
        exception on.
        """
        self._forget_retry()
        if self.pressed:
            raise KeyboardInterrupt
        self.gentle = True

    def _on_signal(self, _number: int, frame: FrameType | None) -> None:
        at_once = self.pressed or not self.gentle
        if self.pressed:
            self._signals.leave_to_the_system()
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


def _write_nowhere() -> None:
    """A terminal that has closed takes no words; what would be said must not end what is left."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (1, 2):
        if _is_device(descriptor):
            os.dup2(nowhere, descriptor)
    os.close(nowhere)


def _is_device(descriptor: int) -> bool:
    """Whether words go to a terminal; one that has closed no longer calls itself one."""
    try:
        return stat.S_ISCHR(os.fstat(descriptor).st_mode)
    except OSError:
        return False
