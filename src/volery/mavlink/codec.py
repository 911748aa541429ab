"""The dialect `common` of MAVLink 2, as pymavlink packs and unpacks it."""

from __future__ import annotations

from functools import cache
from typing import Any

from volery.core.errors import BridgeError

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""


@cache
def dialect() -> Any:
    """The module of pymavlink with messages and enumerations. `BridgeError` where it is missing."""
    try:
        from pymavlink.dialects.v20 import common
    except ImportError:
        raise BridgeError(
            'MAVLink needs pymavlink: pip install "volery[mavlink]" brings it'
        ) from None
    return common


class Codec:
    """Packs messages of one vehicle; unpacks whole frames."""

    def __init__(self, system: int, component: int = AUTOPILOT) -> None:
        self._mav = dialect().MAVLink(None, system, component)

    def pack(self, message: Any, sequence: int) -> bytes:
        """A frame with a sequence number from 0 to 255."""
        self._mav.seq = sequence
        packed: bytes = message.pack(self._mav)
        return packed


class Parser:
    """Cuts a stream of bytes into messages; what is broken or unknown is passed over.

    signing: secret key of 32 bytes with which all frames must be signed; None: signatures are not
    looked at.
    """

    def __init__(self, signing: bytes | None = None) -> None:
        self._mav = dialect().MAVLink(None, 0, 0)
        self._mav.robust_parsing = True
        if signing is not None:
            self._mav.signing.secret_key = signing

    def feed(self, data: bytes) -> list[Any]:
        """Messages that `data` completes; `get_msgbuf()` has the bytes of each."""
        unknown = dialect().MAVLink_bad_data, dialect().MAVLink_unknown
        messages = self._mav.parse_buffer(bytearray(data)) or ()
        return [message for message in messages if not isinstance(message, unknown)]
