"""Settles the futures of flight commands from events and flight modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.engine.events import Event, EventKind
from volery.runtime.vehicles.flight_future import CommandResult, FlightFuture

FleetRow = tuple[Fleet, int]
"""Fleet and row of a UAV."""

_CONTACTS = (EventKind.IMPACT, EventKind.COLLISION)
_COMMANDS = {
    FlightMode.TAKE_OFF: ("take_off", (FlightMode.TAKE_OFF,), FlightMode.HOLD),
    FlightMode.GO_TO: ("go_to", (FlightMode.GO_TO,), FlightMode.HOLD),
    FlightMode.LAND: ("land", (FlightMode.LAND,), FlightMode.LANDED),
    FlightMode.RETURN: ("return_home", (FlightMode.RETURN, FlightMode.LAND), FlightMode.LANDED),
}
"""Command, modes and final mode of a UAV in a flight mode that ends."""
CHECK_PERIOD_S = 0.02
"""Period of the checks for what ends without an event: braking, teleports."""


class FlightRuns(Protocol):
    """Advances the simulation for code that waits for flight commands."""

    def is_busy(self) -> bool:
        """Returns whether another thread advances the simulation now."""

    def wait(self, is_done: Callable[[], bool], timeout_s: float) -> bool:
        """Advances the simulation, or waits for it, until `is_done()`; returns whether it is."""

    async def wait_async(self, is_done: Callable[[], bool]) -> None:
        """Advances the simulation, or waits for it, and lets other coroutines run in between."""


class FlightFutures:
    """Futures of the present flight commands of all UAVs, at most one of each.

    fleet_row_of: returns fleet and row of a UAV by name; raises `CommandError` once it is deleted.
    """

    def __init__(self, fleet_row_of: Callable[[str], FleetRow], runs: FlightRuns) -> None:
        self._fleet_row_of = fleet_row_of
        self._runs = runs
        self._has_new_events = False
        """Whether events of this tick may still be on their way to `happened`."""
        self._pending: dict[str, FlightFuture] = {}
        self._checked: dict[str, FlightFuture] = {}
        """Pending futures that may end without an event while code waits for their callbacks."""
        self._is_closed = False

    def begin(
        self, uav: str, command: str, active: tuple[FlightMode, ...], final: FlightMode
    ) -> FlightFuture:
        """Returns the future of a command that a UAV has just accepted.

        Raises `CommandError` if the simulation is closed.
        """
        if self._is_closed:
            raise CommandError("the simulation is closed; make a new one")
        self.replace(uav, command)
        future = FlightFuture(self, uav, command, active, final)
        self._pending[uav] = future
        if command == "hold":
            self._checked[uav] = future
        return future

    def watch(self, future: FlightFuture) -> None:
        """Checks a future in each period, because code waits for its callbacks."""
        if not future.is_settled:
            self._checked[future.uav] = future

    def replace(self, uav: str, command: str) -> None:
        """Fails a UAV's pending future, because it has accepted another command."""
        self.fail(uav, f"{command} replaced it")

    def replace_all(self, command: str, mode: FlightMode) -> None:
        """Fails the pending futures of UAVs that a batch has just set to `mode`."""
        for uav in tuple(self._pending):
            fleet, row = self._fleet_row_of(uav)
            if fleet.mode(row) is mode:
                self.replace(uav, command)

    def fail(self, uav: str, reason: str) -> None:
        """Fails a UAV's pending future."""
        future = self._pending.pop(uav, None)
        if future is not None:
            self._checked.pop(uav, None)
            future.fail(self._time_s(future), reason)

    def fail_all(self, reason: str) -> None:
        """Fails all pending futures."""
        for uav in tuple(self._pending):
            self.fail(uav, reason)

    def close(self) -> None:
        """Fails all pending futures; no command begins any more."""
        self.fail_all("the simulation was closed")
        self._is_closed = True

    def pending(self, uav: str) -> FlightFuture | None:
        """Returns the future of a UAV's present command, None without one.

        A command that was given without a handle, such as the take-off of an environment, has one
        from now on.
        """
        future = self._pending.get(uav)
        if future is None or future.done():
            fleet, row = self._fleet_row_of(uav)
            mode = fleet.mode(row)
            return self.begin(uav, *_COMMANDS[mode]) if mode in _COMMANDS else None
        return future

    # ------------------------------------------------------------------------------ what settles

    @property
    def has_pending(self) -> bool:
        """Whether any command has not ended."""
        return bool(self._pending)

    @property
    def needs_checks(self) -> bool:
        """Whether `check` has futures to check."""
        return bool(self._checked)

    def check(self) -> None:
        """Settles what has ended without an event."""
        for future in tuple(self._checked.values()):
            if not future.is_settled:
                self._settle(future)

    def happened(self, event: Event) -> None:
        """Settles the futures of the event's UAVs, if the event ends their commands."""
        if not self._pending:
            return
        self._has_new_events = True
        try:
            for uav, other in ((event.uav, event.partner), (event.partner, event.uav)):
                if uav in self._pending:
                    self._take(event, self._pending[uav], other)
        finally:
            self._has_new_events = False

    def update(self, future: FlightFuture) -> None:
        """Settles the future if its UAV brakes no more, has crashed or has left its modes.

        Changes nothing while the state may be ahead of the events that explain it: in another
        thread than the run's, and between two events of a tick.
        """
        if not (future.is_settled or self._has_new_events or self._runs.is_busy()):
            self._settle(future)

    def _take(self, event: Event, future: FlightFuture, other: str) -> None:
        fleet, row = self._fleet_row_of(future.uav)
        mode = fleet.mode(row)
        if mode is FlightMode.CRASHED and event.kind in _CONTACTS:
            self.fail(future.uav, f"it hit {other} at {event.speed_m_s:.2f} m/s and crashed")
        elif event.kind is EventKind.MODE and event.uav == future.uav:
            if mode is future.final and future.command != "hold":
                self._complete(future, event.time_ns)
            else:
                self._settle(future)

    def _settle(self, future: FlightFuture) -> None:
        try:
            fleet, row = self._fleet_row_of(future.uav)
        except CommandError as error:
            self.fail(future.uav, str(error))
            return
        mode = fleet.mode(row)
        if future.command == "hold" and mode is FlightMode.HOLD:
            if not fleet.is_braking(row):
                self._complete(future, fleet.time_ns)
        elif mode is FlightMode.CRASHED:
            self.fail(future.uav, "it crashed")
        elif mode not in future.active:
            self.fail(future.uav, f"its flight mode changed to {mode.name}")

    def describe(self, future: FlightFuture) -> str:
        """Returns mode and position of a future's UAV."""
        fleet, row = self._fleet_row_of(future.uav)
        x, y, z = fleet.state.position_map[row].tolist()
        return f"{fleet.mode(row).name} at ({x:.2f}, {y:.2f}, {z:.2f}) m"

    def wait(self, future: FlightFuture, timeout_s: float) -> bool:
        """Advances the simulation, or waits for it, until the future is done; returns if it is."""
        self.watch(future)
        return self._runs.wait(future.done, timeout_s)

    async def wait_async(self, future: FlightFuture) -> None:
        """Waits like `wait`, without a limit, and lets other coroutines run in between."""
        self.watch(future)
        await self._runs.wait_async(future.done)

    # ----------------------------------------------------------------------------------- inside

    def _complete(self, future: FlightFuture, time_ns: int) -> None:
        self._pending.pop(future.uav, None)
        self._checked.pop(future.uav, None)
        fleet, row = self._fleet_row_of(future.uav)
        x, y, z = fleet.state.position_map[row].tolist()
        future.complete(CommandResult(time_ns, (x, y, z), fleet.mode(row)))

    def _time_s(self, future: FlightFuture) -> float:
        try:
            return s_from_ns(self._fleet_row_of(future.uav)[0].time_ns)
        except CommandError:
            return 0.0
