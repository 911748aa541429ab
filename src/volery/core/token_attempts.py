"""Limits the rate of wrong tokens shown to a server, without locking any client out.

Clients of one address are checked one after the other, in order of arrival. A correct token takes
no time; a wrong token delays the next client for PENALTY_S, unless its own client disconnects. At
most MAX_PENALTIES addresses do so at once. So an address gets at most 1 / PENALTY_S wrong guesses a
second and all addresses together MAX_PENALTIES times that, however many connections they open. A
client with the correct token waits at most for earlier clients of its own address.

    async with guesses.turn(address):
        if not shows_token(given, token):
            await guesses.penalize(gone)
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
from collections.abc import AsyncIterator, Awaitable, Callable

PENALTY_S = 0.05
MAX_PENALTIES = 5
_IPV6_PREFIX = 64
"""Length of the prefix that one customer's addresses share, bits."""


class TokenAttempts:
    """The limits of one server, used in one event loop. penalty_s: None: PENALTY_S."""

    def __init__(self, penalty_s: float | None = None, max_penalties: int = MAX_PENALTIES) -> None:
        self._penalty_s = PENALTY_S if penalty_s is None else penalty_s
        self._penalties = asyncio.Semaphore(max_penalties)
        self._queues: dict[str, _Queue] = {}

    @property
    def num_waiting(self) -> int:
        """Number of clients that wait for their turn or have it."""
        return sum(queue.num_clients for queue in self._queues.values())

    @contextlib.asynccontextmanager
    async def turn(self, address: str) -> AsyncIterator[None]:
        """Waits until earlier clients of the same address have been checked."""
        key = _network_of(address)
        queue = self._queues.setdefault(key, _Queue())
        queue.num_clients += 1
        try:
            async with queue.lock:
                yield
        finally:
            queue.num_clients -= 1
            if not queue.num_clients:
                self._queues.pop(key, None)

    async def penalize(self, gone: Callable[[], Awaitable[object]] | None = None) -> None:
        """Holds the turn after a wrong token, unless the client disconnects.

        gone: waits until the client has disconnected.
        """
        async with self._penalties:
            if gone is None:
                await asyncio.sleep(self._penalty_s)
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(gone(), self._penalty_s)


class _Queue:
    """The clients of one address."""

    def __init__(self) -> None:
        self.lock = asyncio.Lock()
        self.num_clients = 0


def _network_of(address: str) -> str:
    """Returns the key of a client: its IPv4 address or its IPv6 network."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    return str(ipaddress.IPv6Network((found, _IPV6_PREFIX), strict=False))
