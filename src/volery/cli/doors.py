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
    from volery.scenario.schema import Scenario


def fit_out(scenario: Scenario, options: RunOptions) -> Scenario:
    """The scenario with what the doors of `options` need: autopilots for MAVLink."""
    if not any(text.partition("=")[0].startswith("mavlink") for text in options.doors):
        return scenario
    from volery.mavlink.outfit import with_autopilots

    return with_autopilots(scenario)


@contextmanager
def open_doors(simulation: Any, options: RunOptions) -> Iterator[None]:
    """Hold the doors of `options` open, and say where they are; none where none was asked for."""
    if not options.doors:
        yield
        return
    from volery.bridges.door_names import DoorKind, Terms, make_door
    from volery.bridges.doors import Doors

    terms = Terms(options.allow_remote, options.token)
    more = {
        "comms": DoorKind(10200, _comms, "makes UAVs stations of a communication server"),
        "mavlink": DoorKind(14540, _mavlink, "MAVLink over UDP, ports as PX4's simulations"),
        "mavlink-tcp": DoorKind(5760, _mavlink_tcp, "MAVLink over TCP, all UAVs on each link"),
        "mavlink-serial": DoorKind(
            57600, _mavlink_serial, "MAVLink on a serial line", on_line=True
        ),
    }
    wanted = [make_door(text, terms, more) for text in options.doors]
    with Doors(simulation.gateway) as doors:
        for door in wanted:
            doors.open(door)
            typer.echo(f"open    {door.name}", err=True)
        simulation.be_prompt()
        yield


def _comms(address: Address, terms: Terms) -> Door:
    from volery.comms.uav_stations import UavStations

    return UavStations(*address, token=terms.token)


def _mavlink(address: Address, terms: Terms) -> Door:
    from volery.mavlink.door import MavlinkUdp

    return MavlinkUdp(*address, anywhere=terms.anywhere)


def _mavlink_tcp(address: Address, terms: Terms) -> Door:
    from volery.mavlink.door import MavlinkTcp

    return MavlinkTcp(*address, anywhere=terms.anywhere)


def _mavlink_serial(address: Address, _terms: Terms) -> Door:
    from volery.mavlink.door import MavlinkSerial

    return MavlinkSerial(*address)
