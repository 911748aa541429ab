"""Links to the clients of an autopilot, and the frames to send on them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from volery.mavlink.codec import Codec

MAX_LINKS = 64
"""Links of one vehicle; frames of further links are ignored (modelling choice)."""
ALL_LINKS = 65535
"""Stands for all open links."""


@dataclass
class LinkState:
    """One connection: its streams and transfers."""

    number: int
    profile: int
    periods_ns: dict[int, int] = field(default_factory=dict)
    """Periods of its streams, by message id."""
    due: list[tuple[int, int]] = field(default_factory=list)
    """Times (ns) and ids of messages to send, a heap."""
    sequence: int = 0
    parameters_to_send: list[int] = field(default_factory=list)
    """Indices of parameters to send, the next one last."""


class ClientLinks:
    """Packs messages into frames for the open links."""

    def __init__(self, system: int) -> None:
        self.open: dict[int, LinkState] = {}
        """Open links by number."""
        self._codec = Codec(system)
        self._sent: list[tuple[int, bytes]] = []

    def send(self, message: Any, link: int = ALL_LINKS) -> None:
        """Sends a message on one link, or on all links."""
        links = self.open
        chosen = links.values() if link == ALL_LINKS else filter(None, [links.get(link)])
        for one in chosen:
            self._sent.append((one.number, self._codec.pack(message, one.sequence)))
            one.sequence = (one.sequence + 1) % 256

    def send_payload(self, number: int, payload: bytes, link: int) -> None:
        """Sends the packed fields of a message on one link; for messages sent by the thousand."""
        one = self.open.get(link)
        if one is not None:
            self._sent.append((link, self._codec.frame(number, payload, one.sequence)))
            one.sequence = (one.sequence + 1) % 256

    def take_sent(self) -> list[tuple[int, bytes]]:
        """Returns the frames sent since the last call, with their links."""
        sent, self._sent = self._sent, []
        return sent
