"""Opens the doors that `volery run` was asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

from volery.cli.flight import RunOptions

if TYPE_CHECKING:
    from volery.bridges.door_names import Address, Terms
    from volery.bridges.doors import Door


@contextmanager
def open_doors(simulation: Any, options: RunOptions) -> Iterator[None]:
    """Hold the doors of `options` open, and say where they are; none where none was asked for."""
    if not options.doors:
        yield
        return
    from volery.bridges.door_names import DoorKind, Terms, make_door
    from volery.bridges.doors import Doors

    terms = Terms(options.allow_remote, options.token, options.domain_id, options.interfaces)
    comms = DoorKind(10200, _comms, "makes UAVs stations of a communication server")
    wanted = [make_door(text, terms, {"comms": comms}) for text in options.doors]
    with Doors(simulation.gateway) as doors:
        for door in wanted:
            doors.open(door)
            typer.echo(f"open    {door.name}", err=True)
        simulation.be_prompt()
        yield


def _comms(address: Address, terms: Terms) -> Door:
    from volery.comms.uav_stations import UavStations

    return UavStations(*address, token=terms.token)
