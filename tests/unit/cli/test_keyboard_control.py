"""Keys at a terminal: a real one, with the real simulation behind it."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import sys
import termios
import time
from types import SimpleNamespace
from typing import Any

import pytest

from volery.cli.keyboard_control import steer
from volery.cli.keys import Keys


class Terminal:
    """A command in a terminal of its own; `expect` reads its screen."""

    def __init__(self, *command: str) -> None:
        self.process, self.terminal = pty.fork()
        if self.process == 0:
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # `nohup` and `&` hand on an ignored one
            os.environ.update(TERM="xterm", COLUMNS="120", LINES="40")
            os.execv(command[0], command)
        self.screen = ""

    def press(self, keys: str) -> None:
        os.write(self.terminal, keys.encode())

    def expect(self, pattern: str, timeout_s: float = 60.0) -> re.Match[str]:
        """What comes next that matches; what stood before it is forgotten."""
        end = time.monotonic() + timeout_s
        while True:
            found = re.search(pattern, self.screen)
            if found:
                self.screen = self.screen[found.end() :]
                return found
            assert time.monotonic() < end, f"no {pattern!r} in {self.screen[-200:]!r}"
            if select.select([self.terminal], [], [], 0.1)[0]:
                text = os.read(self.terminal, 65536).decode(errors="replace")
                self.screen += re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text)

    def local_flags(self) -> int:
        flags: int = termios.tcgetattr(self.terminal)[3]
        return flags

    def end(self) -> int:
        try:
            while os.read(self.terminal, 65536):
                pass
        except OSError:  # Linux: the other side is closed
            pass
        _, status = os.waitpid(self.process, 0)
        os.close(self.terminal)
        return os.waitstatus_to_exitcode(status)


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_keys_steer_a_flight() -> None:
    terminal = Terminal(
        sys.executable, "-m", "volery", "run", "hover", "--seconds", "900", "--speed", "1"
    )
    terminal.expect(r"1\.\d of 900 s", 240.0)
    assert not terminal.local_flags() & (termios.ICANON | termios.ECHO)
    terminal.press(" ")
    at = float(terminal.expect(r"paused at (\d+\.\d{3}) of 900 s").group(1))
    terminal.press(".")
    terminal.expect(rf"paused at {at + 0.001:.3f} ")
    terminal.press("..s")
    terminal.expect(rf"paused at {at + 0.004:.3f} ")
    terminal.press("m ")
    terminal.expect(r" [1-9]\d\d\.\d of 900 s", timeout_s=80.0)  # faster than real time
    terminal.press("\x03")
    terminal.expect(r"Stopped with Ctrl-C: flew")
    assert terminal.local_flags() & (termios.ICANON | termios.ECHO)
    assert terminal.end() == 130


class Steered(SimpleNamespace):
    """Notes what a simulation receives."""

    def pause(self) -> None:
        self.paused = True

    def resume(self) -> None:
        self.paused = False

    def single_step(self) -> None:
        self.steps += 1

    def set_speed(self, speed: float | None) -> None:
        self.speed = speed


def steered(keys: str, speed: float | None = None, factor: float = 10.0) -> Any:
    simulation = Steered(paused=False, steps=0, speed=speed)
    for key in keys:
        steer(simulation, key, factor)
    return simulation


def test_what_keys_mean() -> None:
    assert steered(" ").paused
    assert not steered("  ").paused
    assert (steered(".").paused, steered(".").steps) == (True, 0)
    assert steered(".s.").steps == 2
    assert steered("x\nQ[A0").__dict__ == steered("").__dict__


@pytest.mark.parametrize(
    ("keys", "before", "after"),
    [
        ("+", 1.0, 2.0),
        ("=+", 0.5, 2.0),
        ("-", 3.0, 1.5),
        ("+", None, None),
        ("-", None, 4.0),  # half of 8, the power of two nearest to the 10 that it ran at
        ("--", None, 2.0),
        ("m", 2.0, None),
        ("-" * 60, 1.0, 2.0**-10),
        ("+" * 60, 1.0, 2.0**16),
    ],
)
def test_keys_change_the_speed(keys: str, before: float | None, after: float | None) -> None:
    assert steered(keys, before).speed == after


def test_keys_of_a_terminal_and_of_none(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        before = termios.tcgetattr(theirs)
        with Keys() as keys:
            assert keys.pressed() == ""
            os.write(ours, b" .\x1b[A")
            assert keys.pressed() == " ."
            termios.tcsetattr(theirs, termios.TCSANOW, before)  # as a shell does that had it
            assert keys.pressed() == ""
            os.write(ours, b"+")
            assert keys.pressed() == "+"
        assert termios.tcgetattr(theirs) == before
        os.close(ours)
        with Keys() as keys:
            assert keys.pressed() == ""
    for nothing in (None, open(os.devnull)):  # noqa: SIM115
        monkeypatch.setattr(sys, "stdin", nothing)
        with Keys() as keys:
            assert keys.pressed() == ""
        if nothing is not None:
            nothing.close()
