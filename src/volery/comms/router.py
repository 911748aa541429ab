"""The communication server without sockets and without a clock.

A shell hands it connections, bytes and the time, and asks it what to send:

    router = Router(RouterSettings(), now_ns=0, boot=1)
    connection = router.connect(now_ns)
    router.receive(connection, data, now_ns)
    for each in router.take_woken():
        send(each, router.take(each, now_ns))

`server` is the shell around it for TCP, `exchange` the one inside a run. The same calls with the
same times give the same bytes. Rules and promises: docs/comms.md.
"""

from __future__ import annotations

import heapq

from volery.comms.addresses import SERVER, is_station
from volery.comms.admission import admit
from volery.comms.bodies import (
    MOST_SEQUENCES,
    Reason,
    Refusal,
    Welcome,
    decode_hello,
    decode_received,
    encode_refusal,
    encode_settled,
    encode_welcome,
)
from volery.comms.directory import Directory
from volery.comms.known import Connection, Known
from volery.comms.link import Link, ideal_link
from volery.comms.protocol import MESSAGES, Frame, Kind, encode_frame
from volery.comms.settings import RouterSettings
from volery.comms.statistics import Statistics, Tally
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError

_SETTLED_AT_ONCE = 64
"""Sequences that a station is told of at once; fewer wait for a while."""
_SETTLED_NS = NS_PER_S // 5


class Router:
    """Takes messages from stations and hands them to those they are meant for.

    Parameters
    ----------
    settings
        The rules as numbers.
    now_ns
        The clock at the start; any clock that never goes back.
    boot
        u32 that tells this start of the server from others.
    link
        Decides what is lost or late between two stations.

    """

    def __init__(
        self, settings: RouterSettings, now_ns: int, boot: int, link: Link = ideal_link
    ) -> None:
        self._settings = settings
        self._boot = boot
        self._link = link
        self._connections: dict[int, Connection] = {}
        self._opened = 0
        self._tally = Tally()
        self._directory = Directory(settings, now_ns)
        self._woken: set[int] = set()
        self._next_settled_ns = now_ns
        self._due: list[tuple[int, int]] = []
        """When a delayed message may go, and to whom."""

    # ----------------------------------------------------------------------------------- the shell

    def connect(self, now_ns: int) -> int | None:
        """Number of a new connection; None: there are too many."""
        if len(self._connections) >= self._settings.most_connections:
            self._tally.refused[Reason.FULL] += 1
            return None
        self._opened += 1
        self._connections[self._opened] = Connection(now_ns, now_ns)
        return self._opened

    def receive(self, connection: int, data: bytes | memoryview, now_ns: int) -> None:
        """Take bytes that came, in pieces of any size."""
        known = self._connections.get(connection)
        if known is None or known.closing:
            return
        for frame in known.parser.feed(data):
            self._take_frame(connection, known, frame, now_ns)
            if self.closing(connection):
                return
        if known.parser.corrupt > self._settings.most_corrupt:
            self._refuse_connection(connection, Reason.PROTOCOL, "too many damaged frames")

    def disconnect(self, connection: int, now_ns: int) -> None:
        """A connection has ended."""
        ended = self._connections.pop(connection, None)
        self._woken.discard(connection)
        if ended is None:
            return
        ended.parser.finish()
        self._tally.add(ended.parser)
        station = ended.station
        if station is not None and station.connection == connection:
            station.connection = None
            station.left_ns = now_ns
            station.mailbox.rewind()

    def tick(self, now_ns: int) -> None:
        """What time brings: silence, age, delayed messages. Call it every 50 ms or so."""
        while self._due and self._due[0][0] <= now_ns:
            self._wake(self._directory.find(heapq.heappop(self._due)[1]))
        for number, connection in list(self._connections.items()):
            self._end_silent(number, connection, now_ns)
        for frame, reason in self._directory.sweep(now_ns):
            if reason is not None:
                self._dispose(frame, reason)
            else:
                self._settle(frame)  # a message to many that is kept for nobody any more
        if now_ns >= self._next_settled_ns:
            self._next_settled_ns = now_ns + _SETTLED_NS
            for station in self._directory.stations():
                if station.settled:
                    self._wake(station)

    @property
    def next_due_ns(self) -> int | None:
        """When the next delayed message may go."""
        return self._due[0][0] if self._due else None

    def take_woken(self) -> list[int]:
        """Connections for which there is something to send, since the last call."""
        woken = sorted(self._woken)
        self._woken.clear()
        return woken

    def take(self, connection: int, now_ns: int, most_bytes: int = 64 << 10) -> bytes:
        """What to send now, some frames; nothing: wait until it is woken."""
        known = self._connections.get(connection)
        if known is None:
            return b""
        frames, known.control = known.control, []
        station = known.station
        if station is None or known.closing:
            return b"".join(frames)
        while station.control:
            frames.append(station.control.popleft())
        if station.settled:
            frames.append(self._settled_frame(station))
        size = 0
        while size < most_bytes:
            frame = station.mailbox.take(now_ns)
            if frame is None:
                break
            frames.append(frame.data)
            size += len(frame.data)
        return b"".join(frames)

    def closing(self, connection: int) -> bool:
        """Whether a connection is to be ended when what `take` gave has been sent."""
        known = self._connections.get(connection)
        return known is None or known.closing

    @property
    def statistics(self) -> Statistics:
        """What has been counted so far."""
        stations = self._directory.stations()
        present = sum(station.connection is not None for station in stations)
        waiting = sum(len(station.mailbox) for station in stations)
        parsers = [connection.parser for connection in self._connections.values()]
        return self._tally.statistics(parsers, present, len(stations) - present, waiting)

    def stations(self) -> dict[int, str]:
        """Addresses and names of the stations that are here."""
        return {s.address: s.name for s in self._directory.stations() if s.connection is not None}

    # ------------------------------------------------------------------------------------ frames

    def _take_frame(self, number: int, connection: Connection, frame: Frame, now_ns: int) -> None:
        station = connection.station
        if station is None:
            self._greet(number, connection, frame, now_ns)
            return
        connection.heard_ns = now_ns
        if frame.source != station.address or frame.session != station.session:
            self._refuse_connection(number, Reason.PROTOCOL, "a frame in another's name")
        elif frame.kind in MESSAGES:
            self._accept(station, frame, now_ns)
        elif frame.kind == Kind.RECEIVED:
            self._take_received(station, frame)
        elif frame.kind == Kind.PING:
            station.control.append(encode_frame(Kind.PONG, SERVER, station.address))
            self._wake(station)
        else:
            self._tally.counts["unexpected"] += 1

    def _greet(self, number: int, connection: Connection, frame: Frame, now_ns: int) -> None:
        try:
            if frame.kind != Kind.HELLO:
                raise CommsError("the first frame must be HELLO")
            refused = admit(decode_hello(frame.payload), frame.source, self._settings)
        except CommsError as error:
            refused = Refusal(Reason.PROTOCOL, 0, str(error))
        if refused is not None:
            self._refuse_connection(number, refused.reason, refused.text)
            return
        station = self._directory.find(frame.source) or self._expect(frame.source, now_ns)
        station.appeared = True
        if station.connection is not None:
            self._replace(station)
        station.name = decode_hello(frame.payload).name
        station.connection, connection.station = number, station
        connection.heard_ns = now_ns
        if station.session != frame.session:
            station.session, station.last = frame.session, 0
            station.unsettled.clear()
            station.control.clear()
        station.settled.clear()  # WELCOME tells it by what it leaves away
        welcome = Welcome(self._boot, station.last, tuple(station.unsettled)[:MOST_SEQUENCES])
        connection.control.append(
            encode_frame(Kind.WELCOME, SERVER, station.address, payload=encode_welcome(welcome))
        )
        self._woken.add(number)

    def _replace(self, station: Known) -> None:
        """The same station anew: the newest wins, since the old connection is most often dead."""
        old = station.connection
        if old is not None:
            self._tally.counts["replaced"] += 1
            self._refuse_connection(old, Reason.REPLACED, "this station has connected anew")
            self._connections[old].station = None
        station.mailbox.rewind()

    def _take_received(self, station: Known, frame: Frame) -> None:
        try:
            for entry in decode_received(frame.payload):
                for came in station.mailbox.received(entry):
                    self._tally.counts["delivered"] += 1
                    self._settle(came)
        except CommsError:
            self._tally.counts["unexpected"] += 1
            return
        self._wake(station)  # there is room on its way again

    # ------------------------------------------------------------------------------------ messages

    def _accept(self, source: Known, frame: Frame, now_ns: int) -> None:
        if frame.sequence <= source.last:
            self._tally.counts["duplicates"] += 1
            return
        source.last = frame.sequence
        self._tally.counts["accepted"] += 1
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
        if is_station(frame.destination) or not self._directory.expects(now_ns):
            self._settle(frame)
        else:  # it stays unsettled as long as it is kept for those who come
            for no_longer in self._directory.keep(frame):
                self._settle(no_longer)

    def _receivers(self, frame: Frame, now_ns: int) -> list[Known] | None:
        """Stations that a message is meant for; None where it is for one that is not known."""
        if not is_station(frame.destination):
            return self._directory.meant(frame)
        station = self._directory.find(frame.destination)
        if station is None and self._directory.expects(now_ns):
            station = self._expect(frame.destination, now_ns)
        return None if station is None else [station]

    def _expect(self, address: int, now_ns: int) -> Known:
        """A station not known before, with what was sent to many and is kept for it."""
        station = self._directory.add(address, now_ns)
        for frame in self._directory.kept_for(address):
            source = self._directory.find(frame.source)
            if source is not None and frame.sequence in source.unsettled:
                source.unsettled[frame.sequence] += 1
            self._post(station, frame, now_ns)
        return station

    def _post(self, station: Known, frame: Frame, now_ns: int) -> None:
        """Put one message into one mailbox."""
        delivery = self._link(now_ns, frame.source, station.address, frame)
        if delivery.lost:
            self._tally.counts["lost_on_link"] += 1
            self._settle(frame)
            return
        posted, due_ns = station.mailbox.put(frame, now_ns, delivery.delay_ns)
        if not posted.kept:
            self._dispose(frame, Reason.FULL, station.address)
            return
        if posted.dropped is not None:
            self._dispose(posted.dropped, Reason.FULL, station.address)
        if station.connection is None:
            self._tally.counts["stored"] += 1
        elif due_ns <= now_ns:
            self._wake(station)
        if due_ns > now_ns:
            heapq.heappush(self._due, (due_ns, station.address))

    def _dispose(self, frame: Frame, reason: Reason, at: int | None = None) -> None:
        """Done with a message that does not come: told for commands, counted for sensing."""
        if frame.kind == Kind.COMMAND or reason is Reason.UNKNOWN:
            self._tally.refused[reason] += 1
            self._tell_refused(frame, reason, frame.destination if at is None else at)
        elif reason is Reason.FULL:
            self._tally.counts["dropped_sensing"] += 1
        elif reason is Reason.RATE:
            self._tally.counts["flooded"] += 1
        if reason is Reason.EXPIRED:
            self._tally.counts["expired"] += 1
        self._settle(frame)

    def _tell_refused(self, frame: Frame, reason: Reason, at: int) -> None:
        source = self._directory.find(frame.source)
        if source is None or source.session != frame.session:
            return
        text = _REFUSED[reason].format(at)
        refusal = encode_refusal(Refusal(reason, frame.sequence, text))
        source.control.append(encode_frame(Kind.REFUSAL, SERVER, frame.source, payload=refusal))
        self._wake(source)

    def _settle(self, frame: Frame) -> None:
        """One station less that has not got this message."""
        source = self._directory.find(frame.source)
        if source is None or source.session != frame.session:
            return
        left = source.unsettled.get(frame.sequence, 0) - 1
        if left > 0:
            source.unsettled[frame.sequence] = left
        elif source.unsettled.pop(frame.sequence, None) is not None:
            source.settled.append(frame.sequence)
            if len(source.settled) >= _SETTLED_AT_ONCE:
                self._wake(source)

    # ------------------------------------------------------------------------------------ small

    def _settled_frame(self, station: Known) -> bytes:
        told = station.settled[:MOST_SEQUENCES]
        del station.settled[:MOST_SEQUENCES]
        return encode_frame(Kind.SETTLED, SERVER, station.address, payload=encode_settled(told))

    def _end_silent(self, number: int, connection: Connection, now_ns: int) -> None:
        greeted = connection.station is not None
        since = connection.heard_ns if greeted else connection.opened_ns
        allowed_s = self._settings.silence_s if greeted else self._settings.hello_s
        if now_ns - since > allowed_s * NS_PER_S and not connection.closing:
            self._tally.counts["silent"] += 1
            connection.closing = True
            self._woken.add(number)

    def _refuse_connection(self, number: int, reason: Reason, text: str) -> None:
        connection = self._connections[number]
        self._tally.refused[reason] += 1
        payload = encode_refusal(Refusal(reason, 0, text))
        to = 0 if connection.station is None else connection.station.address
        connection.control.append(encode_frame(Kind.REFUSAL, SERVER, to, payload=payload))
        connection.closing = True
        self._woken.add(number)

    def _wake(self, station: Known | None) -> None:
        if station is not None and station.connection is not None:
            self._woken.add(station.connection)


_REFUSED = {
    Reason.UNKNOWN: "no station {} has ever been here",
    Reason.FULL: "too many commands wait for station {}",
    Reason.RATE: "too many messages a second (to {})",
    Reason.EXPIRED: "station {} did not come back in time",
}
