"""The interface of radio models: loss and delay of a message between two stations.

The router calls it once for each message and each addressed station. A radio model computes the
result from the stations' positions, the obstacles between them and its own random stream; without a
model the link is ideal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from volery.comms.protocol import StationFrame


class Delivery(NamedTuple):
    """Loss and delay of one message to one station."""

    lost: bool = False
    delay_ns: int = 0
    """Time between its arrival at the server and its delivery; later messages never overtake it."""


Link = Callable[[int, int, int, StationFrame], Delivery]
"""Returns the `Delivery` of a message: time, ns by the router's clock, source, destination, frame.

The destination is the station, also if the frame is addressed to many.
"""

AT_ONCE = Delivery()


def ideal_link(_time_ns: int, _source: int, _destination: int, _frame: StationFrame) -> Delivery:
    """Delivers every message at once."""
    return AT_ONCE
