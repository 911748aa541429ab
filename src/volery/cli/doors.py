"""Opens the doors that `volery run` was asked for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

from volery.cli.door_checks import check_autopilots
from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.bridges.door_names import Address, Terms
    from volery.bridges.doors import Door
    from volery.mavlink.hil.lock_step import Patience
    from volery.mavlink.hil.px4_door import Px4Door
    from volery.mavlink.hil.px4_processes import Px4Instances
    from volery.scenario.schema import Scenario

_LONGEST_START_S = 60.0
"""Wall time in which PX4s must have connected."""
_LOOK_S = 0.05


def fit_out(scenario: Scenario, options: RunOptions) -> Scenario:
    """The scenario with what the doors of `options` need: autopilots, or sensors for real ones."""
    if options.px4_dir is not None:
        from volery.mavlink.hil.px4_processes import find_px4

        find_px4(options.px4_dir)  # a wrong folder is told before anything is built
    check_autopilots(scenario, options)
    names = {text.partition("=")[0] for text in options.doors}
    if any(name.startswith("mavlink") for name in names):
        from volery.mavlink.scenario_setup import with_autopilots

        scenario = with_autopilots(scenario)
    if names & {"px4", "px4-serial"}:
        from volery.mavlink.scenario_setup import with_px4

        scenario = with_px4(scenario)
    if "ardupilot" in names:
        from volery.mavlink.scenario_setup import with_ardupilot

        scenario = with_ardupilot(scenario)
    return scenario


@contextmanager
def open_doors(simulation: Any, options: RunOptions) -> Iterator[None]:
    """Hold the doors of `options` open, and say where they are; none where none was asked for."""
    if not options.doors:
        yield
        return
    from volery.bridges.door_names import DoorKind, Terms, make_door
    from volery.bridges.doors import Doors

    patience, key = _patience_of(options), _key_of(options)
    terms = Terms(
        options.allow_remote,
        options.token,
        options.domain_id,
        options.interfaces,
        report=lambda text: typer.echo(text, err=True),
    )
    more = {
        "comms": DoorKind(10200, _comms),
        "mavlink": DoorKind(14540, lambda address, terms: _mavlink(address, terms, key)),
        "px4": DoorKind(
            4560,
            lambda address, terms: _px4(
                address, terms, patience, are_ours=options.px4_dir is not None
            ),
        ),
        "px4-serial": DoorKind(
            921600, lambda address, _terms: _px4_serial(address, patience), on_line=True
        ),
        "ardupilot": DoorKind(
            9002, lambda address, terms: _ardupilot(address, terms, patience, simulation)
        ),
        "mavlink-tcp": DoorKind(5760, lambda address, terms: _mavlink_tcp(address, terms, key)),
        "mavlink-serial": DoorKind(
            57600, lambda address, _terms: _mavlink_serial(address, key), on_line=True
        ),
    }
    wanted = [make_door(text, terms, more) for text in options.doors]
    with Doors(simulation.gateway) as doors:
        for door in wanted:
            doors.open(door)
            typer.echo(f"open    {door.name}", err=True)
        simulation.be_prompt()
        with _px4_instances(simulation, wanted, options):
            yield


def _comms(address: Address, terms: Terms) -> Door:
    from volery.comms.station.station_bridge import UavStations

    return UavStations(*address, token=terms.token)


def _mavlink(address: Address, terms: Terms, key: bytes | None) -> Door:
    from volery.mavlink.links.udp_door import MavlinkUdp

    return MavlinkUdp(*address, anywhere=terms.anywhere, key=key)


def _mavlink_tcp(address: Address, terms: Terms, key: bytes | None) -> Door:
    from volery.mavlink.links.tcp_door import MavlinkTcp

    return MavlinkTcp(*address, anywhere=terms.anywhere, key=key)


def _mavlink_serial(address: Address, key: bytes | None) -> Door:
    from volery.mavlink.links.serial_door import MavlinkSerial

    return MavlinkSerial(*address, key=key)


def _key_of(options: RunOptions) -> bytes | None:
    if options.mavlink_key is None:
        return None
    from volery.mavlink.links.signing import key_of

    return key_of(options.mavlink_key)


def _px4(address: Address, terms: Terms, patience: Patience, *, are_ours: bool) -> Door:
    """`are_ours`: the run starts the PX4s, and tells by itself of those that do not come."""
    from volery.mavlink.hil.connection_notice import NOTICE_S
    from volery.mavlink.hil.px4_door import Px4Door

    return Px4Door(
        *address,
        patience=patience,
        anywhere=terms.anywhere,
        notice_s=None if are_ours else NOTICE_S,
    )


def _px4_serial(address: Address, patience: Patience) -> Door:
    from volery.mavlink.hil.px4_serial_door import Px4Serial

    return Px4Serial(*address, patience=patience)


def _ardupilot(address: Address, terms: Terms, patience: Patience, simulation: Any) -> Door:
    from volery.mavlink.hil.ardupilot_door import ArdupilotDoor
    from volery.mavlink.hil.ardupilot_json import Rotor

    rotors = {
        name: [
            Rotor(place.position_m[0], place.position_m[1], place.direction)
            for place in uav.airframe.rotors.places
        ]
        for name, uav in getattr(simulation, "uavs", {}).items()
    }
    return ArdupilotDoor(rotors, *address, patience=patience, anywhere=terms.anywhere)


def _patience_of(options: RunOptions) -> Patience:
    from volery.mavlink.hil.lock_step import Patience

    return Patience(options.autopilot_timeout_s, options.drop_silent)


@contextmanager
def _px4_instances(simulation: Any, doors: list[Door], options: RunOptions) -> Iterator[None]:
    """Run a PX4 for each UAV where that was asked for, and wait until all are connected."""
    if options.px4_dir is None:
        yield
        return
    from volery.cli.px4 import parameters_for
    from volery.mavlink.hil.px4_door import Px4Door
    from volery.mavlink.hil.px4_processes import Px4Instances, find_px4

    build, count = find_px4(options.px4_dir), len(simulation.uav_names)
    parameters = [parameters_for(uav.airframe) for uav in simulation.uavs.values()]
    door = next(door for door in doors if isinstance(door, Px4Door))
    with Px4Instances(build, count, speed=options.speed, parameters=parameters) as instances:
        typer.echo(f"started {build.binary}, instances 0 to {count - 1}", err=True)
        end_s = time.monotonic() + _LONGEST_START_S
        while len(door.connected) < count:
            if instances.wait(_LOOK_S) or time.monotonic() > end_s:
                raise BridgeError(instances.failure or _missing(simulation, door, instances))
        yield


def _missing(simulation: Any, door: Px4Door, instances: Px4Instances) -> str:
    """Which PX4s have not connected, where to, and what they said last."""
    return "\n".join(
        f"{uav}: PX4 {number} has not connected to {door.address(number)} within "
        f"{_LONGEST_START_S:g} s; it said last:{instances.words_of(number) or ' nothing'}"
        for number, uav in enumerate(simulation.uav_names)
        if uav not in door.connected
    )
