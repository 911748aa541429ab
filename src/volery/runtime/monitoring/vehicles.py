"""Publishes `/volery/vehicles`: mode, position, battery and operator of every UAV."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.clock import s_from_ns
from volery.engine.engine import Engine
from volery.graph.lazy_list import LazyList
from volery.graph.messages import Point, Vector3, header, message_type
from volery.graph.session import Gateway
from volery.runtime.monitoring.live_topic import LiveTopic
from volery.runtime.vehicles.uav import Uav

TOPIC = "/volery/vehicles"
_STATE = "volery_interfaces/msg/VehicleState"
_ALL = "volery_interfaces/msg/VehicleStates"
_PERIOD_S = 0.2
_MIN_PERIOD_S = 0.2
_MODES = tuple(FlightMode(k).name for k in range(len(FlightMode)))
NEVER_S = -1.0


@dataclass(frozen=True, eq=False)
class _Build:
    """Constant properties of a fleet."""

    fleet: Fleet
    airframes: list[str]
    full_speed: NDArray[np.float64]
    """Sum of the rotors' full speeds (N,), rad/s."""
    has_battery: NDArray[np.bool_]


class VehicleTopic:
    """Publishes all UAVs of an engine.

    `uavs` are their handles, `gateway` knows their clients, `operator_of` returns a UAV's operator.
    """

    def __init__(
        self,
        engine: Engine,
        uavs: Mapping[str, Uav],
        gateway: Gateway,
        operator_of: Callable[[str], str],
    ) -> None:
        self._engine = engine
        self._uavs = uavs
        self._gateway = gateway
        self._build = _build_of(engine.fleet)
        self._operator_of = operator_of
        publisher = gateway.graph.advertise(TOPIC, _ALL)
        self.present = LiveTopic(publisher, self.message, self.content, _PERIOD_S, _MIN_PERIOD_S)

    def message(self) -> Any:
        """Returns the present state of all UAVs as a VehicleStates."""
        build, state = self._present_build(), self._engine.fleet.state
        modes = self._engine.fleet.modes
        in_air = (modes != FlightMode.LANDED) & ~state.on_ground & ~state.asleep
        battery = np.where(build.has_battery, state.battery_charge, math.nan)
        voltage = np.where(build.has_battery, state.battery_voltage, math.nan)
        rotors = state.rotor_speed.sum(axis=1) / build.full_speed
        columns = (
            self._engine.names,
            build.airframes,
            [self._uavs[name].type_name for name in self._engine.names],
            [_MODES[mode] for mode in modes.tolist()],
            in_air.tolist(),
            state.crashed.tolist(),
            battery.astype(np.float32).tolist(),
            voltage.astype(np.float32).tolist(),
            np.hstack([state.position_map, state.velocity_map]),
            rotors.astype(np.float32).tolist(),
            [self._command_age_s(name) for name in self._engine.names],
            [self._operator_of(name) for name in self._engine.names],
        )
        vehicles = LazyList(len(build.airframes), lambda: _vehicles(*columns))
        return message_type(_ALL)(header(self._engine.time_ns, "map"), vehicles)

    def content(self) -> tuple[Any, ...]:
        """Returns the content of the message in a form that is quick to build and to compare."""
        engine, state = self._engine, self._engine.fleet.state
        return (
            engine.time_ns,
            engine.names,
            engine.fleet.modes.tobytes(),
            state.crashed.tobytes(),
            state.position_map.tobytes(),
            state.velocity_map.tobytes(),
            state.battery_charge.tobytes(),
            self._gateway.commands,
            tuple(self._operator_of(name) for name in engine.names),
        )

    def _command_age_s(self, name: str) -> float:
        now_ns, commanded_ns = self._engine.time_ns, self._gateway.commanded_ns.get(name)
        if commanded_ns is None or commanded_ns > now_ns:  # an earlier state was restored
            return NEVER_S
        return s_from_ns(now_ns - commanded_ns)

    def _present_build(self) -> _Build:
        if self._build.fleet is not self._engine.fleet:
            self._build = _build_of(self._engine.fleet)
        return self._build


def _vehicles(*columns: Any) -> Iterator[Any]:
    """Yields one VehicleState per row; columns are its fields, position and velocity in one."""
    state_type = message_type(_STATE)
    for *head, motion, rotors, age_s, operator in zip(*columns, strict=True):
        x, y, z, *velocity = motion.tolist()
        yield state_type(*head, Point(x, y, z), Vector3(*velocity), rotors, age_s, operator)


def _build_of(fleet: Fleet) -> _Build:
    airframes = fleet.airframes
    rotors = [len(a.rotors.places) * a.rotors.max_speed_rad_s for a in airframes]
    return _Build(
        fleet,
        [airframe.name for airframe in airframes],
        np.array(rotors),
        np.array([airframe.battery is not None for airframe in airframes]),
    )
