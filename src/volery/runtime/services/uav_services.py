"""Serves commands with arguments, and the readiness, of one UAV: `/uavN/...`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from volery.control.flight_modes import FlightMode
from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.runtime.services.results import Close, Fields, Handler, offer_command
from volery.runtime.vehicles.raw_setpoints import steer_to_message, turn_to_message
from volery.runtime.vehicles.uav import Uav

_TRIGGER = "std_srvs/srv/Trigger"
_OURS = "volery_interfaces/srv"


def offer_uav_services(graph: Graph, uav: Uav) -> Iterator[Close]:
    """Creates the services of a UAV beside those of `runtime.vehicles.command_interface`.

    Yields the function that destroys each.
    """
    services: tuple[tuple[str, str, Handler], ...] = (
        ("arm", _TRIGGER, lambda _request: _arm(uav)),
        ("disarm", _TRIGGER, lambda _request: _disarm(uav)),
        ("kill", _TRIGGER, lambda _request: uav.stop_rotors()),
        ("take_off_to", f"{_OURS}/TakeOffTo", lambda request: _take_off(uav, request)),
        ("go_to", f"{_OURS}/GoTo", lambda request: _go_to(uav, request)),
        (
            "set_position_target",
            f"{_OURS}/SetPositionTarget",
            lambda request: steer_to_message(uav, request.target),
        ),
        (
            "set_attitude_target",
            f"{_OURS}/SetAttitudeTarget",
            lambda request: turn_to_message(uav, request.target),
        ),
        (
            "set_landing_speed",
            f"{_OURS}/SetLandingSpeed",
            lambda request: uav.set_landing_speed(request.speed),
        ),
        (
            "set_command_timeout",
            f"{_OURS}/SetCommandTimeout",
            lambda request: uav.set_command_timeout(request.seconds),
        ),
    )
    for name, srvtype, handler in services:
        yield offer_command(graph, f"/{uav.name}/{name}", srvtype, handler)


def _arm(uav: Uav) -> Fields:
    """Returns a message: no armed state exists, a landed UAV is ready for a take-off."""
    if uav.mode is FlightMode.CRASHED:
        raise CommandError(f"{uav.name} has crashed")
    if uav.mode is FlightMode.LANDED:
        return {"message": f"{uav.name} is ready; its rotors turn with take_off"}
    return {"message": f"{uav.name} flies ({uav.mode.name}); nothing to arm"}


def _disarm(uav: Uav) -> Fields:
    if uav.mode in (FlightMode.LANDED, FlightMode.CRASHED):
        return {"message": f"the rotors of {uav.name} do not turn"}
    raise CommandError(f"{uav.name} flies ({uav.mode.name}); land it, or kill it: it then falls")


def _take_off(uav: Uav, request: Any) -> None:
    uav.take_off(request.altitude)


def _go_to(uav: Uav, request: Any) -> None:
    position = request.position
    if uav.mode is FlightMode.TAKE_OFF:
        raise CommandError(f"{uav.name} takes off; wait until it holds")
    uav.go_to([position.x, position.y, position.z], None if request.keep_heading else request.yaw)
