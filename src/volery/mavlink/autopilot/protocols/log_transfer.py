"""Sends flight logs to clients at a bounded rate.

As in PX4, each link has one request at a time, which a new one replaces, and a log has the number
of the link's last list. Answers are sent at a bounded rate of simulated time, shared by the links,
so that many requests cost no more than one.
"""

from __future__ import annotations

import struct
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field

from volery.mavlink.autopilot.client_links import ClientLinks
from volery.mavlink.autopilot.logs.log_storage import LogStorage, StoredLog
from volery.mavlink.codec import dialect

FRAMES_PER_STATE = 10
"""Frames sent with each state of the vehicles, a hundred times a simulated second: 90 kB/s
(modelling choice)."""
_FRAMES_PER_TURN = 5
"""Frames of a link before the next link has its turn."""
_DATA_BYTES = 90
"""Bytes of a LOG_DATA message; one with fewer bytes is the last one."""
_LOG_DATA = 120
_HEAD = struct.Struct("<IHB")


@dataclass
class _Request:
    """Request of a link: entries of its list, or bytes of a log."""

    listed: tuple[StoredLog, ...]
    entries: range = field(default=range(0))
    log: StoredLog | None = None
    number: int = 0
    offset: int = 0
    remaining: int = 0


class TransferRate:
    """Shares the rate among the vehicles of a run that have data to send."""

    def __init__(self) -> None:
        self._now_ns = -1
        self._num_sending = 0
        self._quota = FRAMES_PER_STATE

    def quota(self, now_ns: int) -> int:
        """Returns how many frames a vehicle with data may send at a time."""
        if now_ns != self._now_ns:
            self._now_ns = now_ns
            self._quota = max(1, FRAMES_PER_STATE // max(1, self._num_sending))
            self._num_sending = 0
        self._num_sending += 1
        return self._quota


class LogTransfers:
    """Requests in progress, by link."""

    def __init__(self, links: ClientLinks, storage: LogStorage) -> None:
        self.pace = TransferRate()
        self._links = links
        self._storage = storage
        self._requests: dict[int, _Request] = {}
        self._waiting: deque[int] = deque()
        """Links with data to send, the next one first."""

    def list_logs(self, link: int, first: int, last: int) -> None:
        """Starts to send the entries of the logs `first` to `last`."""
        listed = tuple(self._storage.logs)
        last = min(last, len(listed) - 1)
        entries = range(min(first, last), last + 1) if listed else range(1)
        self._set(link, _Request(listed, entries))

    def send_data(self, link: int, number: int, offset: int, count: int) -> None:
        """Starts to send `count` bytes of a log from `offset` on."""
        before = self._requests.get(link)
        listed = tuple(self._storage.logs) if before is None else before.listed
        if number < len(listed):
            log = listed[number]
            count = max(0, min(count, log.size - offset))
            self._set(link, _Request(listed, range(0), log, number, offset, count))

    def forget(self, link: int) -> None:
        """Cancels the request of a link."""
        self._requests.pop(link, None)
        with suppress(ValueError):
            self._waiting.remove(link)

    def clear(self) -> None:
        """Cancels all requests."""
        self._requests.clear()
        self._waiting.clear()

    def send_some(self, now_ns: int) -> None:
        """Continues the answers, the links in turn."""
        num_frames = self.pace.quota(now_ns) if self._waiting else 0
        while num_frames > 0 and self._waiting:
            link = self._waiting.popleft()
            request, turn = self._requests[link], min(num_frames, _FRAMES_PER_TURN)
            send = self._send_entries if request.log is None else self._send_data
            num_sent, is_done = send(link, request, turn)
            num_frames -= num_sent
            if not is_done:
                self._waiting.append(link)

    def _set(self, link: int, request: _Request) -> None:
        self._requests[link] = request
        if link not in self._waiting:
            self._waiting.append(link)

    def _send_entries(self, link: int, request: _Request, turn: int) -> tuple[int, bool]:
        """Sends the next LOG_ENTRY messages; returns how many, and whether the last one is sent."""
        entry, listed = dialect().MAVLink_log_entry_message, request.listed
        chosen, request.entries = request.entries[:turn], request.entries[turn:]
        for number in chosen:
            if not listed:  # a single entry reports that there are none
                self._links.send(entry(0, 0, 0, 0, 0), link)
                continue
            log = listed[number]
            self._links.send(
                entry(number, len(listed), len(listed) - 1, log.time_s, log.size), link
            )
        return len(chosen), not request.entries

    def _send_data(self, link: int, request: _Request, turn: int) -> tuple[int, bool]:
        """Sends the next LOG_DATA messages; returns how many, and whether the last one is sent."""
        assert request.log is not None
        wanted = min(request.remaining, turn * _DATA_BYTES)
        try:
            data = self._storage.read(request.log, request.offset, wanted)
        except OSError:
            data = b""
        pieces = [data[k : k + _DATA_BYTES] for k in range(0, len(data), _DATA_BYTES)] or [b""]
        for piece in pieces:
            head = _HEAD.pack(request.offset & 0xFFFFFFFF, request.number, len(piece))
            self._links.send_payload(_LOG_DATA, head + piece.ljust(_DATA_BYTES, b"\0"), link)
            request.offset += len(piece)
            request.remaining -= len(piece)
        return len(pieces), len(data) < wanted or request.remaining <= 0
