"""`volery play`: plays a recorded log over bridges, with a clock that can seek."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cli.bridges import open_bridges
from volery.cli.flight import RunOptions
from volery.cli.interrupt import Interrupts, stopped_how
from volery.cli.keyboard_control import steer
from volery.cli.keys import Keys
from volery.cli.terminal import echo_line
from volery.core.plurals import counted

if TYPE_CHECKING:
    from volery.runtime.replay.log_player import LogPlayer

_BRIDGES = ("rosbridge",)
"""Bridges that open by default."""
_LEAP_S = 5.0
_LEAPS = {",": -_LEAP_S, "/": _LEAP_S}


class _StoppedError(Exception):
    """Signals between two steps that Ctrl-C was pressed."""


def play(
    log: Path, options: RunOptions, *, scenario: Path | None, loop: bool, paused: bool
) -> None:
    """Plays a log until Ctrl-C, or until a client quits.

    scenario: the user's scenario file of the flight; without it, data files are read from the log's
    folder. Raises `RecordingError` if there is no log or the log is empty.
    """
    from volery.bridges.logs.one_file import one_file
    from volery.runtime.replay.log_player import LogPlayer
    from volery.scenario.load import load_scenario

    own = None if scenario is None else load_scenario(scenario)
    with (
        Interrupts() as interrupts,
        one_file(log) as (path, problem),
        LogPlayer(path, speed=options.speed, loop=loop, paused=paused, own=own) as player,
    ):
        interrupts.be_gentle()
        if problem:
            echo_line(f"{log}: {problem}", err=True)
        _introduce(player)
        with (
            open_bridges(player.gateway, replace(options, bridges=options.bridges or _BRIDGES)),
            Keys() as keys,
        ):

            def look(_progress: Any) -> None:
                if interrupts.pressed:
                    raise _StoppedError
                for key in keys.pressed():
                    if key in _LEAPS:
                        player.seek(player.time_s + _LEAPS[key])
                    else:
                        steer(player, key, 1.0)

            try:
                player.run(on_progress=look)
            except _StoppedError:
                echo_line(f"Stopped {stopped_how()} at {player.time_s:.3f} s", err=True)


def _introduce(player: LogPlayer) -> None:
    log = player.describe()
    origin = f", a flight of '{log['scenario']}'" if log["scenario"] else ""
    span = f"{player.start_s:.3f} to {player.end_s:.3f} s"
    messages = counted(sum(log["counts"]), "message")
    echo_line(f"playing {player.path} ({span}, {messages}{origin})", err=True)
    if log["problem"]:
        mend = f"`volery recover {player.path}` writes what is readable"
        echo_line(f"        {log['problem']}; {mend}", err=True)
