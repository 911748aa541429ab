"""Schedules faults, and applies them to fleet, sensors, radios and wind at their times."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from typing import Any, NamedTuple, Protocol, TypeAlias

from volery.control.fleet import Fleet
from volery.control.setpoints import MAX_COORDINATE, checked
from volery.core.arrays import Array
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError
from volery.engine.engine import Engine, SensorBank
from volery.engine.events import EventKind
from volery.scenario.faults import (
    DisplacementFault,
    Fault,
    GnssFault,
    GustFault,
    JammingFault,
    LastingFault,
    MotorFault,
    RadioFault,
    SensorFault,
)
from volery.sensors.faults import FaultableBank
from volery.sensors.gnss import GnssBank
from volery.vehicle.plant_types import RigidBody
from volery.world.weather import Gust

_log = logging.getLogger(__name__)

_Actions: TypeAlias = tuple[Callable[[], Any], Callable[[], Any] | None]
"""What begins a fault, and what ends it; None: it ends by itself."""


class Radios(Protocol):
    """The radios of the UAVs."""

    def check(self, name: str) -> None:
        """Raises `CommandError` if a UAV has no radio."""

    def silence(self, name: str, by: int) -> None:
        """Adds (1) or removes (-1) a fault of a radio."""

    def restore_all(self, name: str) -> None:
        """Restores a radio."""

    def check_jamming(self) -> None:
        """Raises `CommandError` if jammers disturb no link."""

    def jam(self, position_map: tuple[float, float, float], power_dbm: float, by: int) -> None:
        """Adds (1) or removes (-1) a jammer at a position, m."""


class _ActiveFault(NamedTuple):
    """A fault that has begun; `number` is that of its plan."""

    number: int
    fault: LastingFault


class FaultPlan:
    """Schedules faults of an engine's UAVs; the scheduled faults are part of its state.

    UAVs are identified by name: rows may change before a fault's time, and a deleted UAV no longer
    fails.
    """

    def __init__(self, engine: Engine, radios: Radios | None = None) -> None:
        self._engine = engine
        self._radios = radios
        self._sound: dict[str, Array] = {}
        """(rotors,) health without faults, by UAV, wear included."""
        self._weak: dict[tuple[str, int], list[float]] = {}
        """Thrust factors of the active faults, by UAV and rotor."""
        self._active: tuple[_ActiveFault, ...] = ()
        self._planned = 0
        """Number of faults so far; a number, unlike a description, belongs to one fault alone."""
        self._enlisted: dict[str, int] = {}
        """Number of faults that had been planned when a UAV was added, by name."""
        self.enlist(engine.names)

    def enlist(self, uavs: Collection[str]) -> None:
        """Records the present rotor health of UAVs as their health without faults."""
        for name in uavs:
            self._enlisted[name] = self._planned
            self._sound[name] = self._fleet.state.rotor_health[self._row(name)].copy()
            self.mend(name)

    def add(self, fault: Fault, *, client: str = "") -> None:
        """Schedules a fault at its time, or at the next tick if that has passed.

        Raises `CommandError` for an unknown UAV, rotor or sensor, and for a fault that is
        impossible in this world. client: external client that injects the fault; if its fault turns
        out to be impossible at its time, it has no effect and is logged, as is a fault of a UAV
        that was deleted and spawned again as another type; otherwise the run ends.
        """
        begin, end = self._actions(fault)
        uav = uav_of(fault)
        self._planned += 1
        number = self._planned

        def begin_it() -> bool:
            begin()
            if isinstance(fault, LastingFault):
                self._list(number, fault)
            return True

        def end_it() -> bool:
            return self._finish([one for one in self._active if one.number == number], end)

        self._at(fault.at_s, begin_it, uav, f"fault: {fault.kind}", client)
        if isinstance(fault, LastingFault) and fault.until_s is not None:
            self._at(fault.until_s, end_it, uav, f"fault over: {fault.kind}", client)

    def end(self, fault: Fault, *, client: str = "") -> None:
        """Ends an active fault at the next tick; has no effect without such a fault.

        The fault's times are ignored: of faults alike, the oldest ends. Raises `CommandError` as
        `add`, and for a gust or a displacement.
        """
        _, end = self._actions(fault)
        if end is None:
            raise CommandError(f"fault: a {fault.kind} cannot be ended: it ends by itself")
        uav = uav_of(fault)

        def end_it() -> bool:
            return self._finish([one for one in self._active if _ends(fault, one.fault)][:1], end)

        self._at(0.0, end_it, uav, f"fault over: {fault.kind}", client)

    @property
    def active(self) -> tuple[LastingFault, ...]:
        """Faults of present UAVs, and of none, that have begun and not ended, oldest first.

        `at_s` is the time at which they began. Gusts and displacements are not among them.
        """
        present = {None, *self._engine.names}
        return tuple(one.fault for one in self._active if uav_of(one.fault) in present)

    def _list(self, number: int, fault: LastingFault) -> None:
        if isinstance(fault, SensorFault):  # a sensor has one fault at a time
            self._strike([one for one in self._active if _ends(fault, one.fault)])
        began = fault.model_copy(update={"at_s": s_from_ns(self._engine.time_ns)})
        self._active = (*self._active, _ActiveFault(number, began))

    def _finish(self, ended: list[_ActiveFault], end: Callable[[], Any] | None) -> bool:
        """Ends active faults; returns whether there are any: one may have ended before."""
        self._strike(ended)
        if ended and end is not None:
            end()
        return bool(ended)

    def _strike(self, ended: list[_ActiveFault]) -> None:
        """Removes faults from the list of active ones."""
        numbers = {one.number for one in ended}
        self._active = tuple(one for one in self._active if one.number not in numbers)

    def mend(self, uav: str) -> None:
        """Clears the rotor faults and radio faults of a UAV that restarts."""
        if self._radios is not None:
            self._radios.restore_all(uav)
        self._weak = {key: fractions for key, fractions in self._weak.items() if key[0] != uav}
        self._active = tuple(one for one in self._active if uav_of(one.fault) != uav)

    def get_state(self) -> dict[str, Any]:
        """Returns the active faults, for a snapshot; engine, fleet and sensors save the rest."""
        weak = {key: list(fractions) for key, fractions in self._weak.items()}
        return {"weak": weak, "active": self._active}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        self._weak = {key: list(fractions) for key, fractions in state["weak"].items()}
        self._active = state["active"]

    @property
    def _fleet(self) -> Fleet:
        return self._engine.fleet

    def _at(
        self, time_s: float, action: Callable[[], bool], uav: str | None, what: str, client: str
    ) -> None:
        """Schedules an action, and an event if it returns that it had an effect."""
        planned = self._planned

        def act() -> None:
            if uav is not None and uav not in self._engine.names:
                return
            note = what
            try:
                if not action():
                    return
            except Exception as error:
                was_respawned = uav is not None and self._enlisted[uav] >= planned
                if not client and not was_respawned:
                    raise
                note = f"{what} is not possible: {error}"
                _log.warning("%s (%s)", note, f"requested by {client}" if client else "planned")
            if uav is not None:
                self._engine.note(self._row(uav), EventKind.FAULT, note)

        self._engine.at(ns_from_s(time_s), act)

    def _actions(self, fault: Fault) -> _Actions:
        """Returns the actions that begin and end a fault; raises `CommandError` if impossible."""
        by_kind: dict[str, Callable[[Any], _Actions]] = {
            "motor": self._motor,
            "sensor": self._sensor,
            "gnss_loss": self._gnss,
            "radio": self._radio,
            "jamming": self._jamming,
            "gust": self._gust,
            "displacement": self._displacement,
        }
        return by_kind[fault.kind](fault)

    def _motor(self, fault: MotorFault) -> _Actions:
        i = self._row(fault.uav)
        rotors = len(self._fleet.airframes[i].rotors.places)
        if fault.rotor >= rotors:
            raise CommandError(f"{fault.uav} has no rotor {fault.rotor}; 0 to {rotors - 1} exist")
        if not isinstance(self._fleet.plants[i], RigidBody):
            raise CommandError(f"{fault.uav} has no motors to fail: its plant is not a rigid body")
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
        """Sets a rotor's health by the worst of its active faults."""
        (uav, rotor), fraction = key, min(self._weak.get(key, ()), default=1.0)
        sound = float(self._sound[uav][rotor])
        self._fleet.set_rotor_health(self._row(uav), rotor, fraction * sound)

    def _sensor(self, fault: SensorFault) -> _Actions:
        bank, row = self._find(fault.uav, fault.sensor)
        value = fault.bias if fault.sigma is None else fault.sigma
        before = bank.faults.get_state()
        try:
            bank.faults.set(row, fault.effect, value)  # raises now for an invalid value
        finally:
            bank.faults.set_state(before)

        def fail() -> None:
            bank, row = self._find(fault.uav, fault.sensor)
            bank.faults.set(row, fault.effect, value)

        def mend() -> None:
            bank, row = self._find(fault.uav, fault.sensor)
            bank.faults.clear(row)

        return fail, mend

    def _radio(self, fault: RadioFault) -> _Actions:
        radios = self._radios
        if radios is None:
            raise CommandError(f"{fault.uav} has no radio: the scenario has no [radio]")
        radios.check(fault.uav)
        return lambda: radios.silence(fault.uav, 1), lambda: radios.silence(fault.uav, -1)

    def _jamming(self, fault: JammingFault) -> _Actions:
        radios, jammer = self._radios, (fault.position_m, fault.power_dbm)
        if radios is None:
            raise CommandError("there is no radio to jam: the scenario has no [radio]")
        radios.check_jamming()
        return lambda: radios.jam(*jammer, 1), lambda: radios.jam(*jammer, -1)

    def _gnss(self, fault: GnssFault) -> _Actions:
        if not self._receivers(self._row(fault.uav)):
            raise CommandError(f"{fault.uav} has no GNSS receiver to lose its fix")
        since = ns_from_s(fault.at_s)

        def deny() -> None:
            row = self._row(fault.uav)
            for receiver in [] if self._is_denied(fault.uav) else self._receivers(row):
                receiver.deny(row, max(since, self._engine.time_ns))

        def allow() -> None:
            row = self._row(fault.uav)
            for receiver in [] if self._is_denied(fault.uav) else self._receivers(row):
                receiver.allow(row, self._engine.time_ns)

        return deny, allow

    def _is_denied(self, uav: str) -> bool:
        """Returns whether an active fault denies a UAV the satellites' signals."""
        faults = (one.fault for one in self._active)
        return any(isinstance(one, GnssFault) and one.uav == uav for one in faults)

    def _receivers(self, row: int) -> list[GnssBank]:
        inner = [b.bank for b in self._engine.banks if isinstance(b, FaultableBank)]
        gnss = [bank for bank in inner if isinstance(bank, GnssBank)]
        return [bank for bank in gnss if any(s.uav == row for s in bank.sensors)]

    def _gust(self, fault: GustFault) -> _Actions:
        def gust_at(start_s: float) -> Gust:
            end_s = start_s + 2.0 * fault.rise_s + fault.hold_s
            return Gust(fault.velocity_m_s, start_s, fault.rise_s, end_s)

        try:
            gust_at(fault.at_s)  # raises now for an impossible gust
        except CommandError as error:
            raise CommandError(f"fault: gust: velocity_m_s: {error}") from None
        return lambda: self._fleet.add_gust(gust_at(s_from_ns(self._engine.time_ns))), None

    def _displacement(self, fault: DisplacementFault) -> _Actions:
        self._row(fault.uav)
        if ns_from_s(fault.at_s) <= self._engine.time_ns:
            self._check_displacement(fault)
        else:
            checked("offset_m", fault.offset_m, (3,), self._max_displacement_m())

        def displace() -> None:
            self._check_displacement(fault)
            self._fleet.displace(self._row(fault.uav), fault.offset_m)

        return displace, None

    def _check_displacement(self, fault: DisplacementFault) -> None:
        """Raises `CommandError` if a UAV would be displaced out of the world or into a solid."""
        engine = self._engine
        there = self._fleet.state.position_map[self._row(fault.uav)] + fault.offset_m
        at = f"fault: {fault.uav} would be displaced to ({there[0]:g}, {there[1]:g}, {there[2]:g})"
        x0, y0, x1, y1 = engine.ground.bounds
        if not (x0 <= there[0] <= x1 and y0 <= there[1] <= y1):
            extent = f"({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m"
            raise CommandError(f"{at} m, beyond the terrain, which extends from {extent}")
        ground_m = float(engine.ground.height(there[0], there[1]))
        if there[2] < ground_m:
            raise CommandError(f"{at} m, under the ground, whose height is {ground_m:g} m there")
        if there[2] > MAX_COORDINATE:
            raise CommandError(f"{at} m, higher than {MAX_COORDINATE:g} m")
        around = int(engine.scene.enclosing(there[None])[0])
        if around >= 0:
            raise CommandError(f"{at} m, inside {engine.scene.instance_name(around)}")

    def _max_displacement_m(self) -> float:
        """Returns the maximum displacement along an axis inside the world, m."""
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


def uav_of(fault: Fault | LastingFault) -> str | None:
    """Returns the UAV of a fault; None: it is of the air or the radio channel."""
    uav: str | None = getattr(fault, "uav", None)
    return uav


def _ends(fault: Fault, active: LastingFault) -> bool:
    """Returns whether the end of `fault` ends an active one."""
    if type(fault) is not type(active) or uav_of(fault) != uav_of(active):
        return False
    if isinstance(fault, JammingFault) and isinstance(active, JammingFault):
        return (fault.position_m, fault.power_dbm) == (active.position_m, active.power_dbm)
    if isinstance(fault, SensorFault) and isinstance(active, SensorFault):
        return fault.sensor == active.sensor
    if isinstance(fault, MotorFault) and isinstance(active, MotorFault):
        same_rotor = fault.rotor == active.rotor
        return same_rotor and fault.thrust_factor == active.thrust_factor
    return True
