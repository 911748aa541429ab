"""Faults on time: what breaks is told to fleet, sensors and air when its time has come."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.setpoints import MAX_COORDINATE, checked
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError
from volery.engine.engine import Engine, SensorBank
from volery.engine.events import EventKind
from volery.scenario.faults import (
    DisplacementFault,
    Fault,
    GnssFault,
    GustFault,
    MotorFault,
    RadioFault,
    SensorFault,
)
from volery.sensors.faults import FaultableBank
from volery.sensors.gnss import GnssBank
from volery.vehicle.plant_types import RigidBody
from volery.world.weather import Gust

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)


class Radios(Protocol):
    """The radios of the UAVs."""

    def check(self, name: str) -> None:
        """`CommandError` where a UAV has none."""

    def silence(self, name: str, by: int) -> None:
        """One fault more (1) or less (-1) keeps a radio from working."""

    def restore_all(self, name: str) -> None:
        """A radio begins anew."""


class FaultPlan:
    """Plans faults of an engine's UAVs; planned ones are part of its state.

    UAVs go by their names: rows may change before a fault's time comes, and one that has been
    deleted meanwhile fails no more.
    """

    def __init__(self, engine: Engine, radios: Radios | None = None) -> None:
        self._engine = engine
        self._radios = radios
        self._sound: dict[str, Array] = {}
        """(rotors,) health without faults, by UAV: what wear has left."""
        self._weak: dict[tuple[str, int], list[float]] = {}
        """Shares of thrust that the present faults leave, by UAV and rotor."""
        self.enlist(engine.names)

    def enlist(self, uavs: Collection[str]) -> None:
        """Take UAVs as they are now for sound ones."""
        for name in uavs:
            self._sound[name] = self._fleet.state.rotor_health[self._row(name)].copy()
            self.mend(name)

    def add(self, fault: Fault, *, client: str = "") -> None:
        """Let a fault happen when its time comes, or at the next tick if that has passed.

        Raises `CommandError` for a UAV, rotor or sensor that there is not, and for what cannot be
        in this world. `client`: the external client that wants it. A fault of a client that turns
        out to be impossible when its time comes changes nothing and is logged; another one ends
        the run.
        """
        begin, end = self._actions(fault)
        uav = getattr(fault, "uav", None)
        until_s = getattr(fault, "until_s", None)
        self._at(fault.at_s, begin, uav, f"fault: {fault.kind}", client)
        if until_s is not None:
            ends_by_itself = isinstance(fault, GnssFault)
            action = end if end is not None and not ends_by_itself else _nothing
            self._at(until_s, action, uav, f"fault over: {fault.kind}", client)

    def end(self, fault: Fault, *, client: str = "") -> None:
        """End a fault that has begun, at the next tick; without such a fault nothing changes.

        Its times do not count. Raises `CommandError` as `add`, and for a gust or a displacement.
        """
        _, end = self._actions(fault)
        if end is None:
            raise CommandError(f"fault: a {fault.kind} cannot be ended: it passes by itself")
        uav = getattr(fault, "uav", None)
        self._at(0.0, end, uav, f"fault over: {fault.kind}", client)

    def mend(self, uav: str) -> None:
        """Forget what weakens the rotors of a UAV that begins anew, and what silences its radio."""
        if self._radios is not None:
            self._radios.restore_all(uav)
        self._weak = {key: shares for key, shares in self._weak.items() if key[0] != uav}

    def get_state(self) -> dict[tuple[str, int], list[float]]:
        """What a snapshot keeps beside what is planned and what fleet and sensors hold."""
        return {key: list(shares) for key, shares in self._weak.items()}

    def set_state(self, state: dict[tuple[str, int], list[float]]) -> None:
        """Go back to a kept state."""
        self._weak = {key: list(shares) for key, shares in state.items()}

    @property
    def _fleet(self) -> Fleet:
        return self._engine.fleet

    def _at(
        self, time_s: float, action: Callable[[], Any], uav: str | None, what: str, client: str
    ) -> None:
        def act() -> None:
            if uav is not None and uav not in self._engine.names:
                return
            told = what
            try:
                action()
            except Exception as error:
                if not client:
                    raise
                told = f"{what} is not possible: {error}"
                _log.warning("%s (asked for by %s)", told, client)
            if uav is not None:
                self._engine.note(self._row(uav), EventKind.FAULT, told)

        self._engine.at(ns_from_s(time_s), act)

    def _actions(self, fault: Fault) -> tuple[Callable[[], Any], Callable[[], Any] | None]:
        """What begins a fault and what ends it; `CommandError` for one that cannot be."""
        if isinstance(fault, GustFault):
            return self._gust(fault), None
        if isinstance(fault, DisplacementFault):
            return self._displacement(fault), None
        if isinstance(fault, MotorFault):
            return self._motor(fault)
        if isinstance(fault, SensorFault):
            return self._sensor(fault)
        if isinstance(fault, RadioFault):
            return self._radio(fault)
        return self._gnss(fault)

    def _motor(self, fault: MotorFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        i = self._row(fault.uav)
        rotors = len(self._fleet.airframes[i].rotors.places)
        if fault.rotor >= rotors:
            raise CommandError(f"{fault.uav} has no rotor {fault.rotor}; 0 to {rotors - 1} exist")
        if not isinstance(self._fleet.plants[i], RigidBody):
            raise CommandError(f"{fault.uav} has no motors to fail: its plant is no rigid body")
        key = fault.uav, fault.rotor

        def weaken() -> None:
            self._weak.setdefault(key, []).append(fault.thrust_factor)
            self._set_health(key)

        def mend() -> None:
            if fault.thrust_factor in self._weak.get(key, ()):
                self._weak[key].remove(fault.thrust_factor)
                self._set_health(key)

        return weaken, mend

    def _set_health(self, key: tuple[str, int]) -> None:
        """The worst of the present faults decides."""
        (uav, rotor), share = key, min(self._weak.get(key, ()), default=1.0)
        sound = float(self._sound[uav][rotor])
        self._fleet.set_rotor_health(self._row(uav), rotor, share * sound)

    def _sensor(self, fault: SensorFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        bank, row = self._find(fault.uav, fault.sensor)
        before = bank.faults.get_state()
        try:
            bank.faults.set(row, fault.effect, fault.bias)  # a bias that does not fit is told now
        finally:
            bank.faults.set_state(before)

        def fail() -> None:
            bank, row = self._find(fault.uav, fault.sensor)
            bank.faults.set(row, fault.effect, fault.bias)

        def mend() -> None:
            bank, row = self._find(fault.uav, fault.sensor)
            bank.faults.clear(row)

        return fail, mend

    def _radio(self, fault: RadioFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        radios = self._radios
        if radios is None:
            raise CommandError(f"{fault.uav} has no radio: the scenario has no [radio]")
        radios.check(fault.uav)
        return lambda: radios.silence(fault.uav, 1), lambda: radios.silence(fault.uav, -1)

    def _gnss(self, fault: GnssFault) -> tuple[Callable[[], Any], Callable[[], Any]]:
        if not self._receivers(self._row(fault.uav)):
            raise CommandError(f"{fault.uav} has no GNSS receiver to lose its fix")
        since = ns_from_s(fault.at_s)
        until = {} if fault.until_s is None else {"until_ns": ns_from_s(fault.until_s)}

        def deny() -> None:
            row = self._row(fault.uav)
            for receiver in self._receivers(row):
                receiver.deny(row, max(since, self._engine.time_ns), **until)

        def allow() -> None:
            row = self._row(fault.uav)
            for receiver in self._receivers(row):
                receiver.allow(row, self._engine.time_ns)

        return deny, allow

    def _receivers(self, row: int) -> list[GnssBank]:
        inner = [b.bank for b in self._engine.banks if isinstance(b, FaultableBank)]
        gnss = [bank for bank in inner if isinstance(bank, GnssBank)]
        return [bank for bank in gnss if any(s.uav == row for s in bank.sensors)]

    def _gust(self, fault: GustFault) -> Callable[[], Any]:
        def gust_at(start_s: float) -> Gust:
            end_s = start_s + 2.0 * fault.rise_s + fault.hold_s
            return Gust(fault.velocity_m_s, start_s, fault.rise_s, end_s)

        try:
            gust_at(fault.at_s)  # one that cannot be is refused now
        except CommandError as error:
            raise CommandError(f"fault: gust: velocity_m_s: {error}") from None
        return lambda: self._fleet.add_gust(gust_at(s_from_ns(self._engine.time_ns)))

    def _displacement(self, fault: DisplacementFault) -> Callable[[], Any]:
        self._row(fault.uav)
        if ns_from_s(fault.at_s) <= self._engine.time_ns:
            self._check_displaced(fault)
        else:
            checked("offset_m", fault.offset_m, (3,), self._longest_way_m())

        def displace() -> None:
            self._check_displaced(fault)
            self._fleet.displace(self._row(fault.uav), fault.offset_m)

        return displace

    def _check_displaced(self, fault: DisplacementFault) -> None:
        """`CommandError` where a UAV would be displaced out of the world, or into something."""
        engine = self._engine
        there = self._fleet.state.position_map[self._row(fault.uav)] + fault.offset_m
        at = f"fault: {fault.uav} would be displaced to ({there[0]:g}, {there[1]:g}, {there[2]:g})"
        x0, y0, x1, y1 = engine.ground.bounds
        if not (x0 <= there[0] <= x1 and y0 <= there[1] <= y1):
            reach = f"({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m"
            raise CommandError(f"{at} m, beyond the terrain, which reaches from {reach}")
        ground_m = float(engine.ground.height(there[0], there[1]))
        if there[2] < ground_m:
            raise CommandError(f"{at} m, under the ground, which lies at {ground_m:g} m there")
        if there[2] > MAX_COORDINATE:
            raise CommandError(f"{at} m, higher than {MAX_COORDINATE:g} m")
        around = int(engine.scene.enclosing(there[None])[0])
        if around >= 0:
            raise CommandError(f"{at} m, inside {engine.scene.instance_name(around)}")

    def _longest_way_m(self) -> float:
        """Longest displacement along an axis that can stay inside the world."""
        x0, y0, x1, y1 = self._engine.ground.bounds
        return float(max(x1 - x0, y1 - y0, MAX_COORDINATE))

    def _row(self, uav: str) -> int:
        try:
            return self._engine.names.index(uav)
        except ValueError:
            known = ", ".join(self._engine.names)
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


def _nothing() -> None:
    """A fault that ends by itself needs nothing to be done."""
