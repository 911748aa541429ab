"""Newest time stamps of signed MAVLink: for all connections of a key, and over restarts.

A stream is a sender's system and component with its link id. Each vehicle accepts only rising
stamps of a stream, over whichever connection they arrive. The newest stamp of each stream is also
kept in a file, so that what one run accepted is no news to the next one.

File: 256 records of 12 bytes: system, component, link id, 0, and the stamp as 8 bytes, little
endian. Each accepted stamp is written at once and so survives the end of the process by a signal.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import struct
import threading
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from volery.core.errors import reason_of
from volery.core.private_folders import private_folder, state_root

_RECORD = struct.Struct("<BBBxQ")
_SLOTS = 256
"""Streams in the file; beyond, the one with the oldest stamp is forgotten."""
_log = logging.getLogger(__name__)


class Stream(NamedTuple):
    """Sender of a signed frame."""

    system: int
    component: int
    link: int


class StampFile:
    """The file of a key's stamps; several runs may use it at a time. Methods raise `OSError`."""

    def __init__(self, path: Path) -> None:
        private_folder(path.parent.parent, path.parent.name)
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, 0o600)
        weakref.finalize(self, os.close, self._descriptor)
        self._slots: dict[Stream, int] = {}

    def read(self) -> dict[Stream, int]:
        """Returns the newest stamp of each stream."""
        data = os.pread(self._descriptor, _SLOTS * _RECORD.size, 0)
        records = _RECORD.iter_unpack(data[: len(data) // _RECORD.size * _RECORD.size])
        found = {}
        for slot, (*stream, stamp) in enumerate(records):
            if stamp:
                self._slots[Stream(*stream)] = slot
                found[Stream(*stream)] = stamp
        return found

    def write(self, stream: Stream, stamp: int) -> None:
        """Writes a stamp unless the file has a newer one."""
        if stream not in self._slots:
            self._reserve(stream)
        at = self._slots[stream] * _RECORD.size
        record = os.pread(self._descriptor, _RECORD.size, at)
        is_known = len(record) == _RECORD.size and record[:3] == bytes(stream)
        if not is_known or _RECORD.unpack(record)[3] < stamp:
            os.pwrite(self._descriptor, _RECORD.pack(*stream, stamp), at)

    def _reserve(self, stream: Stream) -> None:
        """Gives a stream a free slot, or that of the oldest stamp."""
        fcntl.flock(self._descriptor, fcntl.LOCK_EX)
        try:
            known = self.read()  # other runs may have added some
            if stream in known:
                return
            if len(known) < _SLOTS:
                slot = min({*range(_SLOTS)} - {self._slots[other] for other in known})
            else:
                slot = self._slots.pop(min(known, key=known.__getitem__))
            os.pwrite(self._descriptor, _RECORD.pack(*stream, 1), slot * _RECORD.size)
            self._slots[stream] = slot
        finally:
            fcntl.flock(self._descriptor, fcntl.LOCK_UN)


class StampLedger:
    """Decides which stamps of which streams are new to which vehicles; safe for all threads.

    file: the newest stamps of all runs; None: they are forgotten at the end. since: smallest stamp
    of streams that are not in the file.
    """

    def __init__(self, file: StampFile | None = None, since: int = 0) -> None:
        self._lock = threading.Lock()
        self._newest: dict[tuple[int, Stream], int] = {}
        self._file = file
        self._before = {} if file is None else file.read()
        """Newest stamps of earlier runs."""
        self._since = since

    def newest(self, vehicle: int, stream: Stream) -> int | None:
        """Returns the newest accepted stamp; None if the vehicle does not know the stream."""
        return self._newest.get((vehicle, stream), self._before.get(stream))

    def take(self, vehicles: Iterable[int], stream: Stream, stamp: int, oldest: int) -> set[int]:
        """Returns the vehicles to which a stamp is new, and remembers it for them.

        oldest: the smallest stamp of a stream that a vehicle does not know.
        """
        floor = max(oldest, self._since) - 1
        with self._lock:
            before = self._before.get(stream, floor)
            found = {
                vehicle
                for vehicle in vehicles
                if stamp > self._newest.get((vehicle, stream), before)
            }
            for vehicle in found:
                self._newest[vehicle, stream] = stamp
            if found:
                self._save(stream, stamp)
        return found

    def _save(self, stream: Stream, stamp: int) -> None:
        if self._file is None:
            return
        try:
            self._file.write(stream, stamp)
        except OSError as error:
            self._file = None
            _log.warning(
                "MAVLink: time stamps cannot be saved: %s; after a restart, messages of the last "
                "minute can be replayed",
                reason_of(error),
            )


def ledger_of(key: bytes, now: int) -> StampLedger:
    """Returns the ledger of a key, the same for all connections of this process.

    Its file lies in the folder of saved state, under a name that does not reveal the key. If it
    cannot be used, only stamps after `now` count as new, with a warning.
    """
    with _opening:
        if key not in _ledgers:
            name = hashlib.sha256(b"volery stamps" + key).hexdigest()[:16]
            try:
                file = StampFile(state_root() / f"mavlink-{name}.stamps")
                _ledgers[key] = StampLedger(file)
            except OSError as error:
                _log.warning(
                    "MAVLink: the file of time stamps cannot be used: %s; messages signed before "
                    "this start are refused",
                    error,
                )
                _ledgers[key] = StampLedger(since=now)
        return _ledgers[key]


_opening = threading.Lock()
_ledgers: dict[bytes, StampLedger] = {}
