"""The communication server without sockets and without a clock.

Its caller passes connections, bytes and the time, and sends what it returns:

    router = Router(RouterSettings(), now_ns=0, boot=1)
    connection = router.connect(now_ns)
    router.receive(connection, data, now_ns)
    for each in router.take_woken():
        send(each, router.take(each, now_ns))

`tcp` runs it over TCP, `comms.local_network` inside a run. The same calls with the same times give
the same bytes. Rules and guarantees: docs/comms.md.
"""

from __future__ import annotations

from volery.comms.addresses import SERVER, Identity
from volery.comms.control_payloads import (
    MAX_SEQUENCES,
    Hello,
    Reason,
    Refusal,
    Welcome,
    decode_hello,
    encode_refusal,
    encode_settled,
    encode_welcome,
)
from volery.comms.link_model import Link, ideal_link
from volery.comms.protocol import MESSAGES, StationFrame, StationFrameKind, encode_frame
from volery.comms.server.dispatcher import Dispatcher
from volery.comms.server.records import StationConnection, StationRecord
from volery.comms.server.settings import RouterSettings
from volery.comms.server.statistics import Statistics
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError
from volery.core.network_access import shows_token
from volery.core.plurals import counted


class Router:
    """Receives messages from stations and forwards them to their receivers.

    Parameters
    ----------
    settings
        The rules as numbers.
    now_ns
        The clock at the start; any clock that never goes back.
    boot
        u32 that identifies this start of the server.
    link
        Decides loss and delay between two stations.

    """

    def __init__(
        self, settings: RouterSettings, now_ns: int, boot: int, link: Link = ideal_link
    ) -> None:
        self._settings = settings
        self._boot = boot
        self._connections: dict[int, StationConnection] = {}
        self._opened = 0
        self._office = Dispatcher(settings, now_ns, link)
        self._tally = self._office.tally
        self._directory = self._office.directory
        self._woken = self._office.woken

    # ---------------------------------------------------------------------------- for the caller

    def connect(self, now_ns: int) -> int | None:
        """Returns the number of a new connection; None: there are too many."""
        if len(self._connections) >= self._settings.max_connections:
            self._tally.refused[Reason.FULL] += 1
            return None
        self._opened += 1
        self._connections[self._opened] = StationConnection(now_ns, now_ns)
        return self._opened

    def receive(self, connection: int, data: bytes | memoryview, now_ns: int) -> None:
        """Processes received bytes, in pieces of any size."""
        known = self._connections.get(connection)
        if known is None or known.closing:
            return
        for frame in known.parser.feed(data):
            self._take_frame(connection, known, frame, now_ns)
            if self.closing(connection):
                return
        if known.parser.corrupt > self._settings.max_corrupt:
            self._refuse_connection(connection, Reason.PROTOCOL, "too many damaged frames")

    def disconnect(self, connection: int, now_ns: int) -> None:
        """Processes the end of a connection."""
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
            station.queue.rewind()

    def forget(self, connection: int, now_ns: int) -> None:
        """Ends a connection whose station will not return, and drops its messages."""
        known = self._connections.get(connection)
        self.disconnect(connection, now_ns)
        if known is not None and known.station is not None:
            self._office.forget(known.station.address)

    def tick(self, now_ns: int) -> None:
        """Processes timeouts and delayed messages. Call it every 50 ms or so."""
        for number, connection in list(self._connections.items()):
            self._end_silent(number, connection, now_ns)
        self._office.tick(now_ns)

    @property
    def next_due_ns(self) -> int | None:
        """Time at which the next delayed message is due, ns; None: there is none."""
        return self._office.next_due_ns

    def take_woken(self) -> list[int]:
        """Returns the connections with data to send, since the last call."""
        woken = sorted(self._woken)
        self._woken.clear()
        return woken

    def take(self, connection: int, now_ns: int, max_bytes: int = 64 << 10) -> bytes:
        """Returns the bytes to send now, some frames; empty: wait for `take_woken`."""
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
        while size < max_bytes:
            frame = station.queue.take(now_ns)
            if frame is None:
                break
            frames.append(frame.data)
            size += len(frame.data)
        return b"".join(frames)

    def hold(self, connection: int, *, is_held: bool) -> None:
        """Marks whether a connection's data waits before it reaches the router."""
        known = self._connections.get(connection)
        if known is not None:
            known.is_held = is_held

    def has_greeted(self, connection: int) -> bool:
        """Returns whether the station of a connection is known."""
        known = self._connections.get(connection)
        return known is not None and known.station is not None

    def closing(self, connection: int) -> bool:
        """Returns whether to close a connection once `take`'s data has been sent."""
        known = self._connections.get(connection)
        return known is None or known.closing

    @property
    def statistics(self) -> Statistics:
        """Statistics so far."""
        stations = self._directory.stations()
        present = sum(station.connection is not None for station in stations)
        waiting = sum(len(station.queue) for station in stations)
        parsers = [connection.parser for connection in self._connections.values()]
        return self._tally.statistics(parsers, present, len(stations) - present, waiting)

    def stations(self) -> dict[int, str]:
        """Returns addresses and names of the connected stations."""
        return {s.address: s.name for s in self._directory.stations() if s.connection is not None}

    # ------------------------------------------------------------------------------------ frames

    def _take_frame(
        self, number: int, connection: StationConnection, frame: StationFrame, now_ns: int
    ) -> None:
        station = connection.station
        if station is None:
            self._greet(number, connection, frame, now_ns)
            return
        connection.received_ns = now_ns
        if frame.source != station.address or frame.session != station.session:
            self._refuse_connection(
                number, Reason.PROTOCOL, "the frame's source is another station"
            )
        elif frame.kind in MESSAGES:
            self._office.accept(station, frame, now_ns)
        elif frame.kind == StationFrameKind.RECEIVED:
            self._office.take_received(station, frame)
        elif frame.kind == StationFrameKind.PING:
            station.control.append(encode_frame(StationFrameKind.PONG, SERVER, station.address))
            self._office.wake(station)
        else:
            self._tally.counts["unexpected"] += 1

    def _greet(
        self, number: int, connection: StationConnection, frame: StationFrame, now_ns: int
    ) -> None:
        try:
            if frame.kind != StationFrameKind.HELLO:
                raise CommsError("the first frame must be HELLO")
            refused = admit(decode_hello(frame.payload), frame.source, self._settings)
        except CommsError as error:
            refused = Refusal(Reason.PROTOCOL, 0, str(error))
        if refused is not None:
            self._refuse_connection(number, refused.reason, refused.text)
            return
        station = self._directory.find(frame.source) or self._office.expect(frame.source, now_ns)
        station.appeared, station.is_gone = True, False
        if station.connection is not None:
            self._replace(station)
        station.name = decode_hello(frame.payload).name
        station.connection, connection.station = number, station
        connection.received_ns = now_ns
        if station.session != frame.session:
            station.session, station.last = frame.session, 0
            station.unsettled.clear()
            station.control.clear()
        station.settled.clear()  # WELCOME implies them
        welcome = Welcome(self._boot, station.last, tuple(station.unsettled)[:MAX_SEQUENCES])
        connection.control.append(
            encode_frame(
                StationFrameKind.WELCOME, SERVER, station.address, payload=encode_welcome(welcome)
            )
        )
        self._woken.add(number)

    def _replace(self, station: StationRecord) -> None:
        """Replaces a station's old connection, which is most often dead."""
        old = station.connection
        if old is not None:
            self._tally.counts["replaced"] += 1
            self._refuse_connection(
                old, Reason.REPLACED, "this station has opened a new connection"
            )
            self._connections[old].station = None
        station.queue.rewind()

    # ---------------------------------------------------------------------------------- internals

    def _settled_frame(self, station: StationRecord) -> bytes:
        settled = station.settled[:MAX_SEQUENCES]
        del station.settled[:MAX_SEQUENCES]
        return encode_frame(
            StationFrameKind.SETTLED, SERVER, station.address, payload=encode_settled(settled)
        )

    def _end_silent(self, number: int, connection: StationConnection, now_ns: int) -> None:
        greeted = connection.station is not None
        since = connection.received_ns if greeted else connection.opened_ns
        allowed_s = self._settings.silence_s if greeted else self._settings.hello_s
        if connection.is_held or connection.closing:
            return
        if now_ns - since > allowed_s * NS_PER_S:
            self._tally.counts["silent"] += 1
            connection.closing = True
            self._woken.add(number)

    def _refuse_connection(self, number: int, reason: Reason, text: str) -> None:
        connection = self._connections[number]
        self._tally.refused[reason] += 1
        payload = encode_refusal(Refusal(reason, 0, text))
        to = 0 if connection.station is None else connection.station.address
        connection.control.append(
            encode_frame(StationFrameKind.REFUSAL, SERVER, to, payload=payload)
        )
        connection.closing = True
        self._woken.add(number)


def admit(hello: Hello, source: int, settings: RouterSettings) -> Refusal | None:
    """Returns None for a station that may join; else the refusal."""
    if not shows_token(hello.token, settings.token):
        return Refusal(Reason.TOKEN, 0, "the token is wrong, or there is none")
    planes = settings.group_size
    if hello.group_size != planes:
        text = f"here a batch has {counted(planes, 'plane')}, not {hello.group_size}"
        return Refusal(Reason.BATCH_SIZE, 0, text)
    try:
        address = Identity(hello.batch, hello.plane).address(planes)
    except CommsError as error:
        return Refusal(Reason.IDENTITY, 0, str(error))
    if address != source:
        text = f"batch {hello.batch}, plane {hello.plane} is station {address}, not {source}"
        return Refusal(Reason.IDENTITY, 0, text)
    return None
