"""A station without sockets and without a clock: it sends, repeats and receives messages.

Its caller passes bytes and the time, and sends what it returns:

    core = StationCore(Identity(0, 1), session=7)
    core.connected(now_ns)
    messages = core.feed(data, now_ns)
    core.send(StationFrameKind.COMMAND, 3, b"...", now_ns)
    write(core.take())

It stores every message until the server settles it, and after each reconnection repeats those that
the server lacks. It passes each received message to its user once, in the order of each source.
"""

from __future__ import annotations

from collections import deque

from volery.comms.addresses import GROUP_SIZE, SERVER, Identity
from volery.comms.control_payloads import (
    Hello,
    Reason,
    Received,
    Refusal,
    decode_refusal,
    decode_settled,
    decode_welcome,
    encode_hello,
    encode_received,
)
from volery.comms.protocol import (
    MESSAGES,
    StationFrame,
    StationFrameKind,
    StationFrameParser,
    encode_frame,
)
from volery.comms.station.send_buffer import SendBuffer
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError

FATAL = frozenset({Reason.IDENTITY, Reason.BATCH_SIZE, Reason.TOKEN, Reason.REPLACED})
"""Refusals after which reconnecting would not help."""

_PING_NS = NS_PER_S
_SILENCE_NS = 3 * NS_PER_S
_ACKNOWLEDGE_AT_ONCE = 64
_REFUSALS_KEPT = 256
_MAX_RECEIVED = 1000
"""Max entries of one RECEIVED, below the limit of payloads."""
_SESSIONS_KEPT = 8
"""Number of sessions for each source: after a restart its older messages may still arrive."""


class StationCore:
    """One station's side of the protocol.

    session: u32, a new one at each start of the station. name, token: sent to the server.
    """

    def __init__(
        self,
        identity: Identity,
        session: int,
        *,
        name: str = "",
        token: str | None = None,
        group_size: int = GROUP_SIZE,
    ) -> None:
        self.address = identity.address(group_size)
        self._session = session
        hello = Hello(identity.batch, identity.plane, group_size, name, token or "")
        self._hello = encode_hello(hello)
        self._parser = StationFrameParser()
        self._held = SendBuffer()
        self._inbox = _ReceiveLog()
        self._out: list[bytes] = []
        self._sequence = 0
        self._spoke_ns = 0
        self._received_ns = 0
        self.joined = False
        """Whether the server has welcomed this connection."""
        self.fatal: Refusal | None = None
        """The refusal after which reconnecting is useless, or None."""
        self.boot = 0
        """Number of the server's start."""
        self.refusals: deque[Refusal] = deque(maxlen=_REFUSALS_KEPT)
        """Refusals by the server, newest last; remove them as they are read."""
        self.corrupt = 0
        """Damaged frames on ended connections."""

    @property
    def unsettled(self) -> int:
        """Number of messages that may have to be repeated."""
        return len(self._held)

    def is_settled(self, sequence: int) -> bool:
        """Returns whether the server has settled a message: delivered or dropped by a rule."""
        return sequence not in self._held

    @property
    def dropped(self) -> int:
        """Measurements that this station dropped because its buffer was full."""
        return self._held.dropped

    @property
    def duplicates(self) -> int:
        """Repeated messages that were not passed on."""
        return self._inbox.duplicates

    def connected(self, now_ns: int) -> None:
        """Begins a new connection with HELLO."""
        self._parser = StationFrameParser()
        self._received_ns = now_ns
        self.joined = False
        self._out = []
        self._send_control(StationFrameKind.HELLO, self._hello, now_ns)

    def disconnected(self) -> None:
        """Processes the end of the connection."""
        self.corrupt += self._parser.corrupt
        self._parser = StationFrameParser()
        self.joined = False
        self._out = []

    def send(
        self,
        kind: StationFrameKind,
        destination: int,
        payload: bytes,
        now_ns: int,
        stamp_ns: int | None = None,
    ) -> int:
        """Sends a message as soon as there is a server; returns its sequence.

        stamp_ns: the frame's time; `now_ns` unless given.

        Raises
        ------
        CommsError
            The payload is too long, the kind is no message, or that destination's buffer is full
            when a command is sent. Measurements replace the oldest one instead.

        """
        if kind not in MESSAGES:
            raise CommsError(f"{kind.name} is not a message kind: use COMMAND or SENSING")
        sequence = self._sequence + 1
        data = encode_frame(
            kind,
            self.address,
            destination,
            self._session,
            sequence,
            now_ns if stamp_ns is None else stamp_ns,
            payload,
        )
        self._held.put(sequence, kind, destination, data)
        self._sequence = sequence
        if self.joined:
            self._out.append(data)
            self._spoke_ns = now_ns
        return sequence

    def feed(self, data: bytes | memoryview, now_ns: int) -> list[StationFrame]:
        """Returns the new messages in these bytes."""
        messages = []
        for frame in self._parser.feed(data):
            self._received_ns = now_ns
            if frame.kind in MESSAGES:
                if self._inbox.is_new(frame):
                    messages.append(frame)
            else:
                self._take_control(frame)
        if len(self._inbox) >= _ACKNOWLEDGE_AT_ONCE:
            self.acknowledge(now_ns)
        return messages

    def acknowledge(self, now_ns: int) -> None:
        """Acknowledges received messages; call it within some 50 ms after `feed`."""
        if not self.joined:
            return
        received = self._inbox.take()
        for start in range(0, len(received), _MAX_RECEIVED):
            part = received[start : start + _MAX_RECEIVED]
            self._send_control(StationFrameKind.RECEIVED, encode_received(part), now_ns)

    @property
    def has_to_acknowledge(self) -> bool:
        """Whether received messages wait for `acknowledge`."""
        return len(self._inbox) > 0

    def tick(self, now_ns: int) -> None:
        """Acknowledges, and pings the server; call it every second or more often."""
        self.acknowledge(now_ns)
        if self.joined and now_ns - self._spoke_ns >= _PING_NS * 9 // 10:
            self._send_control(StationFrameKind.PING, b"", now_ns)

    def is_deaf(self, now_ns: int) -> bool:
        """Returns whether the server has sent nothing for so long that it must be dead."""
        return now_ns - self._received_ns > _SILENCE_NS

    def take(self) -> bytes:
        """Returns the bytes to send now."""
        data = b"".join(self._out)
        self._out = []
        return data

    def _take_control(self, frame: StationFrame) -> None:
        try:
            if frame.kind == StationFrameKind.SETTLED:
                self._held.settle(decode_settled(frame.payload))
            elif frame.kind == StationFrameKind.WELCOME:
                self._take_welcome(frame.payload)
            elif frame.kind == StationFrameKind.REFUSAL:
                self._take_refusal(decode_refusal(frame.payload))
        except CommsError:
            self.corrupt += 1

    def _take_welcome(self, payload: bytes) -> None:
        welcome = decode_welcome(payload)
        self.boot = welcome.boot
        self._held.reconcile(welcome.last, welcome.unsettled)
        self._out += self._held.after(welcome.last)
        self.joined = True

    def _take_refusal(self, refusal: Refusal) -> None:
        self.refusals.append(refusal)
        if refusal.sequence:
            self._held.refuse(refusal.sequence)
        elif refusal.reason in FATAL:
            self.fatal = refusal

    def _send_control(self, kind: StationFrameKind, payload: bytes, now_ns: int) -> None:
        self._out.append(
            encode_frame(kind, self.address, SERVER, self._session, 0, now_ns, payload)
        )
        self._spoke_ns = now_ns


class _ReceiveLog:
    """Stores the last sequence of each source in each of its latest sessions.

    It detects repeated messages, and collects acknowledgements.
    """

    def __init__(self) -> None:
        self._last: dict[int, dict[int, int]] = {}
        self._logged: dict[tuple[int, int], int] = {}
        self._unacknowledged = 0
        self.duplicates = 0
        """Number of repeated messages."""

    def __len__(self) -> int:
        """Returns the number of messages since the last `take`."""
        return self._unacknowledged

    def is_new(self, frame: StationFrame) -> bool:
        """Returns whether a message is new; it is acknowledged in either case."""
        sessions = self._last.setdefault(frame.source, {})
        last = sessions.get(frame.session, 0)
        newest = max(last, frame.sequence)
        sessions[frame.session] = newest
        if len(sessions) > _SESSIONS_KEPT:
            del sessions[next(iter(sessions))]
        self._logged[frame.source, frame.session] = frame.sequence
        self._unacknowledged += 1
        new = frame.sequence > last
        self.duplicates += not new
        return new

    def take(self) -> list[Received]:
        """Returns the pending acknowledgements and clears them."""
        received = [
            Received(source, session, last) for (source, session), last in self._logged.items()
        ]
        self._logged.clear()
        self._unacknowledged = 0
        return received
