"""`volery play`: a recorded log behind bridges, with a clock that can be put anywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from volery.cli.bridges import open_bridges
from volery.cli.flight import RunOptions
from volery.cli.interrupt import Interrupts, stopped_how
from volery.cli.keyboard_control import steer
from volery.cli.keys import Keys
from volery.core.plurals import counted

_BRIDGES = ("rosbridge",)
"""Opened where no bridge is named: a log is played for somebody."""
_LEAP_S = 5.0
_LEAPS = {",": -_LEAP_S, "/": _LEAP_S}


class _StoppedError(Exception):
    """Ctrl-C was pressed."""


def play(
    log: Path, options: RunOptions, *, scenario: Path | None, loop: bool, paused: bool
) -> None:
    """Play a log until Ctrl-C, or until a client wants it to quit.

    scenario: the user's own file of what was flown; without it files lie beside the log.

    Raises `RecordingError` where there is no log, or nothing in it.
    """
    from volery.runtime.replay.log_player import LogPlayer
    from volery.scenario.load import load_scenario

    own = None if scenario is None else load_scenario(scenario)
    with (
        Interrupts() as interrupts,
        LogPlayer(log, speed=options.speed, loop=loop, paused=paused, own=own) as player,
    ):
        interrupts.be_gentle()
        _introduce(player)
        with (
            open_bridges(player, replace(options, bridges=options.bridges or _BRIDGES)),
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
                typer.echo(f"Stopped {stopped_how()} at {player.time_s:.3f} s", err=True)


def _introduce(player: Any) -> None:
    told = player.describe()
    what = f", a flight of '{told['scenario']}'" if told["scenario"] else ""
    span = f"{player.start_s:.3f} to {player.end_s:.3f} s"
    messages = counted(sum(told["counts"]), "message")
    typer.echo(f"playing {player.path} ({span}, {messages}{what})", err=True)
    if told["problem"]:
        mend = f"`volery recover {player.path}` writes what is readable"
        typer.echo(f"        {told['problem']}; {mend}", err=True)
