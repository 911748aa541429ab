"""Streams: sends messages on each link at their rates, in simulated time.

Rates are those of PX4's links: `onboard` for a companion computer, `normal` for a ground station
(`mavlink_main.cpp` of PX4 1.18). SET_MESSAGE_INTERVAL changes them for its link.
"""

from __future__ import annotations

import heapq
from typing import Any

from volery.mavlink.autopilot.client_links import LinkState
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import telemetry
from volery.mavlink.autopilot.protocols.parameter_protocol import send_some
from volery.mavlink.codec import dialect

NONE, ONBOARD, GROUND = 0, 1, 2
_ALWAYS = {0: 1.0}
_NORMAL = (
    _ALWAYS
    | {1: 1.0, 24: 5.0, 29: 1.0, 30: 15.0, 31: 10.0, 32: 1.0, 33: 5.0, 36: 1.0, 42: 1.0, 49: 0.2}
    | {
        74: 4.0,
        83: 2.0,
        85: 1.5,
        141: 1.0,
        147: 0.5,
        230: 0.5,
        242: 0.5,
        245: 1.0,
        360: 2.0,
        436: 0.5,
    }
)
RATES_HZ: dict[int, dict[int, float]] = {
    NONE: _ALWAYS,
    ONBOARD: _ALWAYS
    | {1: 5.0, 2: 1.0, 24: 5.0, 29: 1.0, 30: 100.0, 31: 50.0, 32: 30.0, 33: 50.0, 36: 10.0, 42: 1.0}
    | {49: 0.2, 74: 10.0, 83: 10.0, 85: 10.0, 105: 50.0, 111: 10.0, 141: 10.0, 147: 0.5}
    | {230: 1.0, 242: 0.5, 245: 5.0, 331: 30.0, 360: 5.0, 436: 0.5},
    GROUND: _NORMAL,
}
"""Rates by profile and message id."""
MIN_PERIOD_NS = 10_000_000
"""Period of the vehicle's state."""
_HEARTBEAT = 0
"""Message whose rate cannot be changed."""


def begin(link: LinkState, now_ns: int) -> LinkState:
    """Sets a link's streams to those of its profile."""
    rates = RATES_HZ.get(link.profile, _ALWAYS)
    link.periods_ns = {number: round(1e9 / rate) for number, rate in rates.items()}
    link.due = [(now_ns, number) for number in sorted(link.periods_ns)]
    return link


def set_period(link: LinkState, number: int, period_us: float, now_ns: int) -> bool:
    """Sets the period of a message on a link: 0 the default, -1 never.

    Returns whether the period is possible. The rate is limited to that of the vehicle's state.
    """
    if number not in telemetry.BUILDERS or number == _HEARTBEAT:
        return False
    if period_us < 0.0:
        link.periods_ns.pop(number, None)
        return True
    usual = RATES_HZ.get(link.profile, _ALWAYS).get(number)
    if period_us == 0.0 and usual is None:
        return set_period(link, number, -1.0, now_ns)
    wanted = 1e9 / usual if period_us == 0.0 and usual is not None else period_us * 1e3
    link.periods_ns[number] = max(MIN_PERIOD_NS, round(min(wanted, 1e15)))
    link.due = [entry for entry in link.due if entry[1] != number]
    heapq.heapify(link.due)
    heapq.heappush(link.due, (now_ns, number))
    return True


def interval_of(link: LinkState, number: int) -> Any:
    """Returns MESSAGE_INTERVAL of a message; -1 for one that is not sent or does not exist."""
    period_ns = link.periods_ns.get(number)
    period_us = -1 if period_ns is None else period_ns // 1000
    return dialect().MAVLink_message_interval_message(number, min(period_us, 2**31 - 1))


def send_due(context: AutopilotContext) -> None:
    """Sends all due messages; each message is built once for all links."""
    now_ns = context.memory.now_ns
    built: dict[int, Any] = {}
    for link in tuple(context.links.open.values()):
        while link.due and link.due[0][0] <= now_ns:
            instant_ns, number = link.due[0]
            period_ns = link.periods_ns.get(number)
            if period_ns is None:  # no longer requested
                heapq.heappop(link.due)
                continue
            late = (now_ns - instant_ns) // period_ns + 1
            heapq.heapreplace(link.due, (instant_ns + late * period_ns, number))
            if number not in built:
                built[number] = telemetry.BUILDERS[number](context)
            if built[number] is not None:
                context.links.send(built[number], link.number)
        if link.parameters_to_send:
            send_some(context, link)
