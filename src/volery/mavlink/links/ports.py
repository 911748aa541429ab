"""Ports and ids, as PX4's simulations have them."""

from __future__ import annotations

ONBOARD_TO, GROUND_TO = 14540, 14550
"""UDP: to a companion computer, each vehicle at a port of its own; to a ground station."""
ONBOARD_FROM, GROUND_FROM = 14580, 18570
"""UDP: where the vehicles listen, each at a port of its own."""
TCP = 5760
"""TCP server for all vehicles; the port of ArduPilot's simulations."""


def number_of(system: int) -> int:
    """Which vehicle a system id is: the first has 1, and its ports are the first of each kind."""
    return system - 1
