"""Dispatches the messages of the communication server.

Each message is accepted once, put into the queues of its receivers, and settled when all of them
have it or a rule has dropped it.
"""

from __future__ import annotations

import heapq

from volery.comms.addresses import SERVER, is_station
from volery.comms.control_payloads import Reason, Refusal, decode_received, encode_refusal
from volery.comms.link_model import Link
from volery.comms.protocol import StationFrame, StationFrameKind, encode_frame
from volery.comms.server.directory import Directory
from volery.comms.server.records import StationRecord
from volery.comms.server.settings import RouterSettings
from volery.comms.server.statistics import Tally
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError

_SETTLED_AT_ONCE = 64
"""Number of settled sequences that is sent at once; fewer wait for `_SETTLED_NS`."""
_SETTLED_NS = NS_PER_S // 5


class Dispatcher:
    """Holds the stations and dispatches their messages. now_ns: the clock at the start."""

    def __init__(self, settings: RouterSettings, now_ns: int, link: Link) -> None:
        self.directory = Directory(settings, now_ns)
        self.tally = Tally()
        self.woken: set[int] = set()
        """Connections with data to send."""
        self._link = link
        self._next_settled_ns = now_ns
        self._due: list[tuple[int, int]] = []
        """Heap of due times, ns, and receivers of delayed messages."""

    @property
    def next_due_ns(self) -> int | None:
        """Time at which the next delayed message is due, ns; None: there is none."""
        return self._due[0][0] if self._due else None

    def tick(self, now_ns: int) -> None:
        """Processes delayed and expired messages, and pending SETTLED frames."""
        while self._due and self._due[0][0] <= now_ns:
            self.wake(self.directory.find(heapq.heappop(self._due)[1]))
        for frame, reason in self.directory.sweep(now_ns):
            if reason is not None:
                self._dispose(frame, reason)
            else:
                self._settle(frame)  # a message to many that is no longer stored
        if now_ns >= self._next_settled_ns:
            self._next_settled_ns = now_ns + _SETTLED_NS
            for station in self.directory.stations():
                if station.settled:
                    self.wake(station)

    def accept(self, source: StationRecord, frame: StationFrame, now_ns: int) -> None:
        """Accepts a message from a station; ignores duplicates."""
        if frame.sequence <= source.last:
            self.tally.counts["duplicates"] += 1
            return
        source.last = frame.sequence
        self.tally.counts["accepted"] += 1
        source.unsettled[frame.sequence] = 1
        if not source.rate.allows(len(frame.data), now_ns):
            self._dispose(frame, Reason.RATE)
            return
        stations = self._receivers(frame, now_ns)
        if stations is None:
            self._dispose(frame, Reason.UNKNOWN)
            return
        source.unsettled[frame.sequence] += len(stations)
        for each in stations:
            self._post(each, frame, now_ns)
        if is_station(frame.destination) or not self.directory.expects(now_ns):
            self._settle(frame)
        else:  # it stays unsettled as long as it is stored for later stations
            for no_longer in self.directory.keep(frame):
                self._settle(no_longer)

    def take_received(self, station: StationRecord, frame: StationFrame) -> None:
        """Processes the acknowledgements of a station."""
        try:
            for entry in decode_received(frame.payload):
                for came in station.queue.received(entry):
                    self.tally.counts["delivered"] += 1
                    self._settle(came)
        except CommsError:
            self.tally.counts["unexpected"] += 1
            return
        self.wake(station)  # its window has room again

    def _receivers(self, frame: StationFrame, now_ns: int) -> list[StationRecord] | None:
        """Returns the receivers of a message; None if no receiver is known.

        Sensing for many may have no receiver.
        """
        if not is_station(frame.destination):
            meant = self.directory.meant(frame)
            vain = (
                not meant
                and frame.kind == StationFrameKind.COMMAND
                and not self.directory.expects(now_ns)
            )
            return None if vain else meant
        station = self.directory.find(frame.destination)
        if station is None and self.directory.expects(now_ns):
            station = self.expect(frame.destination, now_ns)
        return None if station is None else [station]

    def expect(self, address: int, now_ns: int) -> StationRecord:
        """Adds a new station, with the stored messages to many."""
        station = self.directory.add(address, now_ns)
        for frame in self.directory.stored_for(address):
            source = self.directory.find(frame.source)
            same = source is not None and source.session == frame.session
            if source is not None and same and frame.sequence in source.unsettled:
                source.unsettled[frame.sequence] += 1
            self._post(station, frame, now_ns)
        return station

    def forget(self, address: int) -> None:
        """Removes a station for good, and settles the messages that wait for it."""
        for frame in self.directory.remove(address):
            self._settle(frame)

    def _post(self, station: StationRecord, frame: StationFrame, now_ns: int) -> None:
        """Puts one message into one queue."""
        delivery = self._link(now_ns, frame.source, station.address, frame)
        if delivery.lost:
            self.tally.counts["lost_on_link"] += 1
            self._settle(frame)
            return
        posted, due_ns = station.queue.put(frame, now_ns, delivery.delay_ns)
        for dropped in posted.dropped:
            self._dispose(dropped, Reason.FULL, station.address)
        if not posted.kept:
            self._dispose(frame, Reason.FULL, station.address)
            return
        if station.connection is None:
            self.tally.counts["stored"] += 1
        elif due_ns <= now_ns:
            self.wake(station)
        if due_ns > now_ns:
            heapq.heappush(self._due, (due_ns, station.address))

    def _dispose(self, frame: StationFrame, reason: Reason, at: int | None = None) -> None:
        """Drops a message: commands are refused, sensing is counted."""
        if frame.kind == StationFrameKind.COMMAND or reason is Reason.UNKNOWN:
            self.tally.refused[reason] += 1
            self._send_refused(frame, reason, frame.destination if at is None else at)
        elif reason is Reason.FULL:
            self.tally.counts["dropped_sensing"] += 1
        elif reason is Reason.RATE:
            self.tally.counts["flooded"] += 1
        if reason is Reason.EXPIRED:
            self.tally.counts["expired"] += 1
        self._settle(frame)

    def _send_refused(self, frame: StationFrame, reason: Reason, at: int) -> None:
        source = self.directory.find(frame.source)
        if source is None or source.session != frame.session:
            return
        known = is_station(at) or reason is not Reason.UNKNOWN
        text = _REFUSED[reason].format(at) if known else "none of the addressed stations is known"
        refusal = encode_refusal(Refusal(reason, frame.sequence, text))
        source.control.append(
            encode_frame(StationFrameKind.REFUSAL, SERVER, frame.source, payload=refusal)
        )
        self.wake(source)

    def _settle(self, frame: StationFrame) -> None:
        """Settles a message for one of its receivers."""
        source = self.directory.find(frame.source)
        if source is None or source.session != frame.session:
            return
        left = source.unsettled.get(frame.sequence, 0) - 1
        if left > 0:
            source.unsettled[frame.sequence] = left
        elif source.unsettled.pop(frame.sequence, None) is not None:
            source.settled.append(frame.sequence)
            if len(source.settled) >= _SETTLED_AT_ONCE:
                self.wake(source)

    def wake(self, station: StationRecord | None) -> None:
        """Marks a station as having data to send."""
        if station is not None and station.connection is not None:
            self.woken.add(station.connection)


_REFUSED = {
    Reason.UNKNOWN: "no station {} has connected so far",
    Reason.FULL: "too many commands wait for station {}",
    Reason.RATE: "too many messages a second (to {})",
    Reason.EXPIRED: "station {} did not reconnect in time",
}
