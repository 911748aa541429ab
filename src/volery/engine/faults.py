"""Faults on time: what breaks is told to fleet, sensors and air when its time has come."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.control.fleet import Fleet
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError
from volery.engine.engine import Engine, SensorBank
from volery.scenario.faults import (
    DisplacementFault,
    Fault,
    GnssFault,
    GustFault,
    MotorFault,
    SensorFault,
)
from volery.sensors.faults import FaultableBank
from volery.sensors.gnss import GnssBank
from volery.world.weather import Gust


class FaultPlan:
    """Plans faults of the UAVs `names` of an engine; planned ones are part of its state."""

    def __init__(self, engine: Engine, names: tuple[str, ...]) -> None:
        self._engine = engine
        self._names = names

    def add(self, fault: Fault) -> None:
        """Let a fault happen when its time comes, or at the next tick if that has passed.

        Raises `CommandError` for a UAV, rotor or sensor that there is not.
        """
        begin: Callable[[], Any]
        end: Callable[[], Any] | None = None
        if isinstance(fault, GustFault):
            begin = self._gust(fault)
        elif isinstance(fault, DisplacementFault):
            begin = self._displacement(fault)
        elif isinstance(fault, MotorFault):
            begin, end = self._motor(fault)
        elif isinstance(fault, SensorFault):
            begin, end = self._sensor(fault)
        else:
            begin = self._gnss(fault)
        self._engine.at(ns_from_s(fault.at_s), begin)
        until_s = getattr(fault, "until_s", None)
        if end is not None and until_s is not None:
            self._engine.at(ns_from_s(until_s), end)

    @property
    def _fleet(self) -> Fleet:
        return self._engine.fleet

    def _motor(self, fault: MotorFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        i = self._row(fault.uav)
        rotors = len(self._fleet.airframes[i].rotors.places)
        if fault.rotor >= rotors:
            raise CommandError(f"{fault.uav} has no rotor {fault.rotor}; 0 to {rotors - 1} exist")
        fresh = float(self._fleet.state.rotor_health[i, fault.rotor])
        return (
            lambda: self._fleet.set_rotor_health(i, fault.rotor, fault.thrust_factor * fresh),
            lambda: self._fleet.set_rotor_health(i, fault.rotor, fresh),
        )

    def _sensor(self, fault: SensorFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        bank, row = self._find(fault.uav, fault.sensor)
        before = bank.faults.get_state()
        try:
            bank.faults.set(row, fault.effect, fault.bias)  # a bias that does not fit is told now
        finally:
            bank.faults.set_state(before)
        return (
            lambda: bank.faults.set(row, fault.effect, fault.bias),
            lambda: bank.faults.clear(row),
        )

    def _gnss(self, fault: GnssFault) -> Callable[[], Any]:
        i = self._row(fault.uav)
        inner = [b.bank for b in self._engine.banks if isinstance(b, FaultableBank)]
        receivers = [
            bank
            for bank in inner
            if isinstance(bank, GnssBank) and any(s.uav == i for s in bank.sensors)
        ]
        if not receivers:
            raise CommandError(f"{fault.uav} has no GNSS receiver to lose its fix")
        since = ns_from_s(fault.at_s)
        until = {} if fault.until_s is None else {"until_ns": ns_from_s(fault.until_s)}

        def deny() -> None:
            for receiver in receivers:
                receiver.deny(i, max(since, self._engine.time_ns), **until)

        return deny

    def _gust(self, fault: GustFault) -> Callable[[], Any]:
        def blow() -> None:
            start = s_from_ns(self._engine.time_ns)
            end = start + 2.0 * fault.rise_s + fault.hold_s
            self._fleet.add_gust(Gust(fault.velocity_m_s, start, fault.rise_s, end))

        return blow

    def _displacement(self, fault: DisplacementFault) -> Callable[[], Any]:
        i = self._row(fault.uav)
        return lambda: self._fleet.displace(i, fault.offset_m)

    def _row(self, uav: str) -> int:
        try:
            return self._names.index(uav)
        except ValueError:
            known = ", ".join(self._names)
            raise CommandError(f"there is no UAV '{uav}'; known: {known}") from None

    def _find(self, uav: str, sensor: str) -> tuple[SensorBank, int]:
        i = self._row(uav)
        known = []
        for bank in self._engine.banks:
            for row, own in enumerate(bank.sensors):
                if own.uav == i and bank.name != "joints":
                    known.append(own.name)
                    if own.name == sensor:
                        return bank, row
        raise CommandError(f"{uav} has no sensor '{sensor}'; known: {', '.join(known)}")
