"""Handles Ctrl-C, SIGTERM and SIGHUP: at once before a flight, between two steps during a flight.

All three signals end a command in the same way: a terminal's Ctrl-C, the stop of a container or
service, a terminal that closes. The second signal ends the command without further files. After
that, SIGTERM and SIGHUP have the system's default effect.
"""

from __future__ import annotations

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
"""Offset that shells add to the number of the signal that ended a process."""


class StopSignals:
    """Context in which the three signals call `on_signal`; SIGHUP only if it is not ignored.

    Does nothing outside the main thread, because only the main thread can handle signals.
    """

    first: ClassVar[signal.Signals | None] = None
    """First signal that the current command received."""

    def __init__(
        self,
        on_signal: Callable[[int, FrameType | None], None],
        signals: tuple[signal.Signals, ...] = _SIGNALS,
    ) -> None:
        self._on_signal = on_signal
        self._signals = signals
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> StopSignals:
        """Installs the handlers."""
        if threading.current_thread() is threading.main_thread():
            for number in self._signals:
                if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                    continue  # `nohup`
                self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_exception: object) -> None:
        """Restores the previous handlers."""
        for number, handler in self._before.items():
            if signal.getsignal(number) == self._take:
                signal.signal(number, handler)

    def leave_to_the_system(self) -> None:
        """Restores the default action of SIGTERM and SIGHUP: the next one ends the process."""
        for number in self._before:
            if number is not signal.SIGINT:
                signal.signal(number, signal.SIG_DFL)

    def _take(self, number: int, frame: FrameType | None) -> None:
        StopSignals.first = StopSignals.first or signal.Signals(number)
        if number == signal.SIGHUP:
            _write_nowhere()
        self._on_signal(number, frame)


def stopped_how() -> str:
    """Returns how the process was stopped, as text for messages: `with Ctrl-C`."""
    return _CAUSES[StopSignals.first or signal.SIGINT]


def stopped_code() -> int:
    """Returns the exit code after a signal: 130, 143 or 129, as in shells."""
    return _FATAL + (StopSignals.first or signal.SIGINT)


def stop_at_once(_number: int, _frame: FrameType | None) -> None:
    """Raises `KeyboardInterrupt`, to end a command that has nothing to write."""
    raise KeyboardInterrupt


class Interrupts:
    """Context that handles the signals; `pressed` is true after the first one."""

    def __init__(self) -> None:
        self.pressed = False
        self.gentle = False
        self._raised = False
        self._retry: threading.Timer | None = None
        self._signals = StopSignals(self._on_signal)
        self._hook: Any = None

    def __enter__(self) -> Interrupts:
        """Installs handlers that raise KeyboardInterrupt until `be_gentle`."""
        self._signals.__enter__()
        self._hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable
        return self

    def __exit__(self, *_exception: object) -> None:
        """Restores the previous handlers.

        After a KeyboardInterrupt the hook stays: the process ends, and half-made objects may live
        as long.
        """
        self._forget_retry()
        self._signals.__exit__()
        if not self._raised:
            sys.unraisablehook = self._hook

    def be_gentle(self) -> None:
        """Makes the next signal only set `pressed`.

        Raises KeyboardInterrupt if an earlier signal was lost. A signal is lost if it arrives in a
        callback of the garbage collector, which cannot raise.
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
            # Unlike `_thread.interrupt_main`, this ends a system call of the main thread.
            again = (threading.main_thread().ident, signal.SIGINT)
            self._retry = threading.Timer(_RETRY_S, signal.pthread_kill, again)
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
        """Ignores lost interrupts and errors of objects that an interrupt left half made."""
        if not (self._raised or issubclass(unraisable.exc_type, KeyboardInterrupt)):
            self._hook(unraisable)


def _is_compiling(frame: FrameType | None) -> bool:
    """Returns whether the compiler runs: its callbacks lose exceptions or fail on them."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith(_COMPILER):
            return True
        frame = frame.f_back
    return False


def _write_nowhere() -> None:
    """Redirects output to the null device: writing to a closed terminal would fail."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (1, 2):
        if _is_device(descriptor):
            os.dup2(nowhere, descriptor)
    os.close(nowhere)


def _is_device(descriptor: int) -> bool:
    """Returns whether output goes to a device; a closed terminal does not report itself as one."""
    try:
        return stat.S_ISCHR(os.fstat(descriptor).st_mode)
    except OSError:
        return False
