"""Opens the doors that `volery run` was asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from volery.cli.flight import RunOptions


@contextmanager
def open_doors(simulation: Any, options: RunOptions) -> Iterator[None]:
    """Hold the doors of `options` open, and say where they are; none where none was asked for."""
    if not options.doors:
        yield
        return
    from volery.bridges.door_names import Terms, make_door
    from volery.bridges.doors import Doors

    terms = Terms(options.allow_remote, options.token)
    wanted = [make_door(text, terms) for text in options.doors]
    with Doors(simulation.gateway) as doors:
        for door in wanted:
            doors.open(door)
            typer.echo(f"open    {door.name}", err=True)
        simulation.be_prompt()
        yield
