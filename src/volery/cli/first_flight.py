"""The flight behind the first page of `volery serve`, until a client chooses a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

RESTART_CHARGE = 0.2
"""Fraction of a battery's charge at which the flight starts again; UAVs warn from 0.15 on."""


class FirstFlight:
    """Starts a flight again before its batteries are low, until a client changes something.

    So a page that is opened hours after the server shows a UAV that flies.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._restarts = False
        """Whether a restart is on its way."""

    def look(self) -> None:
        """Starts the flight again if it is time; the thread of the simulation calls it."""
        simulation = self._simulation
        if simulation.commands.has_changes or self._restarts:
            return
        if min(uav.battery_charge for uav in simulation.uavs.values()) < RESTART_CHARGE:
            self._restarts = True
            simulation.post(self._restart)

    def _restart(self) -> None:
        self._restarts = False
        if not self._simulation.commands.has_changes:
            self._simulation.reset()
