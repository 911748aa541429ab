"""Signs frames of MAVLink 2 and checks signatures: only holders of the key send, replays fail.

A frame's signature consists of its link's number, a time stamp in 10 us since 2015 and six bytes of
the SHA-256 of the key and all preceding bytes, see
https://mavlink.io/en/guide/message_signing.html.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
from collections.abc import Callable, Collection
from pathlib import Path

from volery.core.errors import BridgeError
from volery.core.wall_time import steady_time_ns
from volery.mavlink.codec import check_of, crc_extra_of
from volery.mavlink.framing import SIGNED, MavlinkFrame, lengths_of
from volery.mavlink.links.stamp_ledger import StampLedger, Stream, ledger_of

_RADIO_STATUS = 109
"""Message of radios, which have no key."""
_BEGIN_S = 1_420_070_400.0
"""2015-01-01 in UNIX time."""
_PER_S = 100_000
_FRESH = 60 * _PER_S
"""Largest age of a stream's first stamp."""
_LAST = 2**48 - 1
_STAMP_AND_HASH, _HASH = 12, 6
"""Bytes at the end of a frame: stamp and hash; hash."""
_SECOND = 0xFD
"""Start of a frame of MAVLink 2."""
_log = logging.getLogger(__name__)


def key_of(path: Path) -> bytes:
    """Returns the key of a file's text: its SHA-256, as ground stations compute it.

    Blanks and line ends around the text are ignored. Raises `BridgeError` if there is no text.
    """
    try:
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BridgeError(f"{path} cannot be read as a key for MAVLink: {error}") from None
    if not text:
        raise BridgeError(f"{path} is empty; a key for MAVLink needs a text")
    return hashlib.sha256(text.encode()).digest()


def steady_time() -> float:
    """Returns UNIX time, s, by the wall clock's reading at the start and the time elapsed since.

    A wall clock that is set back would make old frames fresh again, one that is set forward refuse
    honest ones. Where it was wrong at the start, stamps follow the newest that is received.
    """
    return 1e-9 * steady_time_ns()


def signing_of(key: bytes | None, link: int) -> Signing:
    """Returns the signing of one of a run's links, which shares its ledger with all others."""
    ledger = None if key is None else ledger_of(key, _stamp_of(steady_time()))
    return Signing(key, link, ledger=ledger)


class Signing:
    """Signs frames sent over one link and checks received ones; without a key all frames pass.

    key: (32,) bytes, or None. link: a number from 0 to 255. clock: UNIX time in s. ledger: newest
    stamps; None: those of this link alone.
    """

    def __init__(
        self,
        key: bytes | None,
        link: int = 0,
        clock: Callable[[], float] = steady_time,
        ledger: StampLedger | None = None,
    ) -> None:
        self._key = key
        self._link = link % 256
        self._clock = clock
        self._stamp = 0
        self._ledger = StampLedger() if ledger is None else ledger
        self._logged: set[tuple[int, int, str]] = set()

    @property
    def has_key(self) -> bool:
        """Whether only signed frames are accepted."""
        return self._key is not None

    def sign(self, data: bytes) -> bytes:
        """Returns the same MAVLink 2 frames, signed."""
        if self._key is None:
            return data
        signed, at = [], 0
        for length in lengths_of(data):
            signed.append(self._signed(data[at : at + length], self._key))
            at += length
        return b"".join(signed)

    def accepts(self, frame: MavlinkFrame, vehicle: int = 0) -> bool:
        """Returns whether a received frame is valid, and new to a vehicle, by its system id."""
        return self.is_genuine(frame) and bool(self.recipients(frame, (vehicle,)))

    def is_genuine(self, frame: MavlinkFrame) -> bool:
        """Returns whether a holder of the key sent a frame, now or earlier."""
        if self._key is None or frame.message == _RADIO_STATUS:
            return True
        data = frame.data
        if data[0] != _SECOND or not data[2] & SIGNED:
            return self._refuse(frame, "it sends unsigned frames")
        if not hmac.compare_digest(_hash(self._key, data[:-_HASH]), data[-_HASH:]):
            return self._refuse(frame, "its signature does not match the key")
        return True

    def recipients(self, frame: MavlinkFrame, vehicles: Collection[int]) -> Collection[int]:
        """Returns those of `vehicles` to which a genuine frame is new, and remembers its stamp."""
        if self._key is None or frame.message == _RADIO_STATUS:
            return vehicles
        data = frame.data
        stamp = int.from_bytes(data[-_STAMP_AND_HASH:-_HASH], "little")
        stream = Stream(frame.system, frame.component, data[-_STAMP_AND_HASH - 1])
        found = self._ledger.take(vehicles, stream, stamp, self._now() - _FRESH)
        if found:
            self._stamp = max(self._stamp, stamp)
        elif all(self._ledger.newest(vehicle, stream) is None for vehicle in vehicles):
            self._refuse(frame, "its clock is more than a minute behind")
        else:
            self._refuse(frame, "its time stamps do not rise; is its link id used twice?")
        return found

    def _refuse(self, frame: MavlinkFrame, why: str) -> bool:
        """Logs why frames of a sender are ignored, once per reason; returns False."""
        source = (frame.system, frame.component, why)
        if source not in self._logged:
            self._logged.add(source)
            _log.warning("MAVLink: system %d, component %d is ignored: %s", *source)
        return False

    def _signed(self, frame: bytes, key: bytes) -> bytes:
        end = len(frame) - 2
        extra = crc_extra_of(int.from_bytes(frame[7:10], "little"))
        body = frame[:2] + bytes((frame[2] | SIGNED,)) + frame[3:end]
        check = check_of(body[1:] + bytes((extra,))).to_bytes(2, "little")
        self._stamp = min(max(self._stamp + 1, self._now()), _LAST)
        stamped = body + check + bytes((self._link,)) + self._stamp.to_bytes(6, "little")
        return stamped + _hash(key, stamped)

    def _now(self) -> int:
        return _stamp_of(self._clock())


def _stamp_of(unix_s: float) -> int:
    return int((unix_s - _BEGIN_S) * _PER_S)


def _hash(key: bytes, data: bytes) -> bytes:
    return hashlib.sha256(key + data).digest()[:_HASH]
