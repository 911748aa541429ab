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
    from volery.mavlink.meetings import Patience
    from volery.scenario.schema import Scenario


def fit_out(scenario: Scenario, options: RunOptions) -> Scenario:
    """The scenario with what the doors of `options` need: autopilots, or sensors for real ones."""
    names = {text.partition("=")[0] for text in options.doors}
    if any(name.startswith("mavlink") for name in names):
        from volery.mavlink.outfit import with_autopilots

        scenario = with_autopilots(scenario)
    if "px4" in names:
        from volery.mavlink.outfit import with_px4

        scenario = with_px4(scenario)
    return scenario


@contextmanager
def open_doors(simulation: Any, options: RunOptions) -> Iterator[None]:
    """Hold the doors of `options` open, and say where they are; none where none was asked for."""
    if not options.doors:
        yield
        return
    from volery.bridges.door_names import DoorKind, Terms, make_door
    from volery.bridges.doors import Doors

    patience = _patience_of(options)
    terms = Terms(options.allow_remote, options.token, options.domain_id, options.interfaces)
    more = {
        "comms": DoorKind(10200, _comms, "makes UAVs stations of a communication server"),
        "mavlink": DoorKind(14540, _mavlink, "MAVLink over UDP, ports as PX4's simulations"),
        "px4": DoorKind(
            4560,
            lambda address, terms: _px4(address, terms, patience),
            "real PX4s fly the UAVs, in lock step",
        ),
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
        with _px4_instances(len(simulation.uav_names), options):
            yield


def _comms(address: Address, terms: Terms) -> Door:
    from volery.comms.uav_stations import UavStations

    return UavStations(*address, token=terms.token)


def _mavlink(address: Address, terms: Terms) -> Door:
    from volery.mavlink.udp_door import MavlinkUdp

    return MavlinkUdp(*address, anywhere=terms.anywhere)


def _mavlink_tcp(address: Address, terms: Terms) -> Door:
    from volery.mavlink.tcp_door import MavlinkTcp

    return MavlinkTcp(*address, anywhere=terms.anywhere)


def _mavlink_serial(address: Address, _terms: Terms) -> Door:
    from volery.mavlink.serial_door import MavlinkSerial

    return MavlinkSerial(*address)


def _px4(address: Address, terms: Terms, patience: Patience) -> Door:
    from volery.mavlink.px4_door import Px4Door

    return Px4Door(*address, patience=patience, anywhere=terms.anywhere)


def _patience_of(options: RunOptions) -> Patience:
    from volery.mavlink.meetings import Patience

    return Patience(options.autopilot_timeout_s, options.drop_silent)


@contextmanager
def _px4_instances(count: int, options: RunOptions) -> Iterator[None]:
    """Run a PX4 for each UAV where that was asked for."""
    if options.px4_dir is None:
        yield
        return
    from volery.mavlink.px4_processes import Px4Instances, find_px4

    build = find_px4(options.px4_dir)
    with Px4Instances(build, count, speed=options.speed):
        typer.echo(f"started {build.binary}, instances 0 to {count - 1}", err=True)
        yield
