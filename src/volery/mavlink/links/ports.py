"""Ports and ids of PX4's simulations."""

from __future__ import annotations

ONBOARD_TO, GROUND_TO = 14540, 14550
"""UDP ports of companion computers, one per vehicle, and of the ground station."""
ONBOARD_FROM, GROUND_FROM = 14580, 18570
"""UDP ports on which the vehicles listen, one per vehicle."""
TCP = 5760
"""TCP server for all vehicles; the port of ArduPilot's simulations."""


def number_of(system: int) -> int:
    """Returns a vehicle's number from its system id.

    Id 1 is number 0, which has the first port of each kind.
    """
    return system - 1
