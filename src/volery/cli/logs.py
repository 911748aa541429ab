"""`volery info` and `volery recover`."""

from __future__ import annotations

from pathlib import Path

import typer

from volery.cli.guard import complain
from volery.cli.tables import print_table
from volery.core.clock import NS_PER_S
from volery.core.errors import RecordingError

_FORMATS = {"mcap": "MCAP", "bag": "ROS 1 bag"}


def show_log(path: Path) -> bool:
    """Print what is in a log; False, after one line on stderr, where it is broken or no log."""
    from volery.bridges.logs.reader import summarize

    try:
        summary = summarize(path)
    except RecordingError as error:
        complain(str(error))
        return False
    start, end = summary.start_ns / NS_PER_S, summary.end_ns / NS_PER_S
    typer.echo(f"file      {path}")
    typer.echo(f"format    {_FORMATS[summary.format]}, {summary.size_bytes / 1e6:.2f} MB")
    typer.echo(f"duration  {summary.duration_s:.3f} s ({start:.3f} to {end:.3f} s)")
    typer.echo(f"messages  {summary.messages:,}")
    rows = [(t.topic, t.msgtype, f"{t.messages:,}", f"{t.rate_hz:.1f} Hz") for t in summary.topics]
    if rows:
        typer.echo("")
        print_table(("topic", "type", "messages", "rate"), rows, right=(2, 3))
    if summary.trouble:
        complain(f"{path}: {summary.trouble}; `volery recover {path}` writes what is readable")
        return False
    return True


def recover_log(path: Path, out: Path | None) -> None:
    """Write the readable part of a log as a whole file and say what was saved."""
    from volery.bridges.logs.reader import summarize
    from volery.bridges.logs.recover import recover

    if out is None and not summarize(path).trouble:
        typer.echo(f"{path} is whole: nothing to recover")
        return
    recovery = recover(path, out)
    if recovery.trouble:
        typer.echo(f"{path}: {recovery.trouble}")
    typer.echo(
        f"{recovery.messages:,} messages up to {recovery.end_ns / NS_PER_S:.3f} s "
        f"written to {recovery.path}"
    )
