"""The directory of stations, and the receivers of an address.

A server that has just started knows no station. For `grace_s` it therefore assumes that every
station is known but away, and stores messages to many for stations that join within that time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from volery.comms.addresses import is_meant, is_station
from volery.comms.control_payloads import Reason
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.server.rate import RateLimit
from volery.comms.server.records import StationRecord
from volery.comms.server.settings import RouterSettings
from volery.comms.server.station_queue import StationQueue
from volery.core.clock import NS_PER_S

_SWEEP_NS = NS_PER_S // 4


class Directory:
    """Holds stations by address. now_ns: start time of the server."""

    def __init__(self, settings: RouterSettings, now_ns: int) -> None:
        self._settings = settings
        self._stations: dict[int, StationRecord] = {}
        self._grace_ends_ns = now_ns + round(settings.grace_s * NS_PER_S)
        self._to_many: deque[StationFrame] = deque()
        self._next_sweep_ns = now_ns

    def find(self, address: int) -> StationRecord | None:
        """Returns a known station, or None."""
        return self._stations.get(address)

    def stations(self) -> list[StationRecord]:
        """Returns all known stations."""
        return list(self._stations.values())

    def add(self, address: int, now_ns: int) -> StationRecord:
        """Adds a new station."""
        rules = self._settings
        rate = RateLimit(rules.rate_messages_s, rules.rate_bytes_s, rules.burst_messages, now_ns)
        station = self._stations[address] = StationRecord(
            address, StationQueue(rules), rate, left_ns=now_ns
        )
        return station

    def remove(self, address: int) -> list[StationFrame]:
        """Removes a station; returns the messages that waited for it."""
        return self._stations.pop(address).queue.clear()

    def expects(self, now_ns: int) -> bool:
        """Returns whether stations that have never connected count as known."""
        return now_ns < self._grace_ends_ns

    def meant(self, frame: StationFrame) -> list[StationRecord]:
        """Returns the stations that a message to many is for, without its source.

        Sensing is not for stations that have been away for long.
        """
        lasts = frame.kind != StationFrameKind.SENSING
        return [
            each
            for each in self._stations.values()
            if (lasts or not each.is_gone) and self._is_meant(each.address, frame)
        ]

    def keep(self, frame: StationFrame) -> list[StationFrame]:
        """Stores a message to many for later stations; returns messages dropped for it."""
        self._to_many.append(frame)
        too_many = max(len(self._to_many) - self._settings.grace_messages, 0)
        return [self._to_many.popleft() for _ in range(too_many)]

    def stored_for(self, address: int) -> list[StationFrame]:
        """Returns the stored messages for a station that joins now."""
        return [frame for frame in self._to_many if self._is_meant(address, frame)]

    def sweep(self, now_ns: int) -> Iterator[tuple[StationFrame, Reason | None]]:
        """Yields expired messages with the reason of the loss.

        None: a message to many that is no longer stored; all stations present have it.
        """
        if now_ns < self._next_sweep_ns:
            return
        self._next_sweep_ns = now_ns + _SWEEP_NS
        if not self.expects(now_ns):
            while self._to_many:
                yield self._to_many.popleft(), None
        for station in self.stations():
            if self._is_forgotten(station, now_ns):
                for frame in self.remove(station.address):
                    to_it = is_station(frame.destination)
                    never = Reason.UNKNOWN if to_it else None  # not among the many
                    yield frame, Reason.EXPIRED if station.appeared else never
            else:
                before_ns = now_ns - round(self._settings.keep_s * NS_PER_S)
                yield from ((f, Reason.EXPIRED) for f in station.queue.expire(before_ns))
                if self._becomes_gone(station, now_ns):
                    station.is_gone = True
                    yield from ((f, Reason.EXPIRED) for f in station.queue.expire_many())

    def _is_forgotten(self, station: StationRecord, now_ns: int) -> bool:
        if station.connection is not None:
            return False
        if not station.appeared:
            return not self.expects(now_ns)
        return now_ns - station.left_ns > self._settings.forget_s * NS_PER_S

    def _becomes_gone(self, station: StationRecord, now_ns: int) -> bool:
        away_ns = now_ns - station.left_ns
        waits = station.is_gone or station.connection is not None
        return not waits and away_ns > self._settings.keep_many_s * NS_PER_S

    def _is_meant(self, address: int, frame: StationFrame) -> bool:
        planes = self._settings.group_size
        return address != frame.source and is_meant(address, frame.destination, planes)
