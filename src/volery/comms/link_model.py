"""Whether and when a message gets through between two stations: the place of a radio model.

The router asks once for each message and each station that it is meant for. A radio model answers
from the stations' places, what stands between them and its own random stream; without one the link
is ideal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from volery.comms.protocol import StationFrame


class Delivery(NamedTuple):
    """Fate of one message on its way to one station."""

    lost: bool = False
    delay_ns: int = 0
    """From the server's taking it to its being handed over; those behind it never overtake."""


Link = Callable[[int, int, int, StationFrame], Delivery]
"""Decides over one message: from time in ns by the router's clock, source, destination and frame.

The destination is the station, also where the frame is addressed to many.
"""

AT_ONCE = Delivery()


def ideal_link(_time_ns: int, _source: int, _destination: int, _frame: StationFrame) -> Delivery:
    """Everything comes at once."""
    return AT_ONCE
