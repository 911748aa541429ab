"""Schedules clients with much traffic in turns, so that clients with little traffic hardly wait.

An asyncio loop runs ready callbacks in order: an answer to one client waits, several times, until
fifty other clients have received their messages. Clients that cost more than their share write in
turns here, a few in each round of the loop, which never idles because of it. Large messages of
clients are processed in turns likewise: a thousand would arrive in one round.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from functools import cached_property

TURN_S = 0.3e-3
"""CPU time of a client's frames after which other clients have their turn."""
TURNS_A_ROUND = 6
"""Clients with much traffic that write in one round of the loop."""
LARGE_BYTES = 32 << 10
"""A message of more bytes is processed in its client's turn; as JSON it costs some 5 ns a byte."""
FRACTION = 0.5
"""Fraction of the loop's time that all clients share equally; a client above its share has much
traffic."""
CREDIT_S = 0.5e-3
"""Cost that a client may run up in advance."""
_MOST_OWED_S = 0.01


class BulkTurns:
    """Queue of the clients of one loop.

    turns_a_round: clients that have their turn in one round of the loop.
    """

    def __init__(
        self, now_s: Callable[[], float] = time.monotonic, turns_a_round: int = TURNS_A_ROUND
    ) -> None:
        self.now_s = now_s
        self._turns_a_round = turns_a_round
        self.num_clients = 0
        self._waiting: deque[asyncio.Future[None]] = deque()
        self._is_granting = False

    @cached_property
    def large_messages(self) -> BulkTurns:
        """Queue for processing large messages of the same clients, one in each round."""
        return BulkTurns(self.now_s, turns_a_round=1)

    async def turn(self) -> None:
        """Waits for this client's turn."""
        loop = asyncio.get_running_loop()
        mine = loop.create_future()
        self._waiting.append(mine)
        if not self._is_granting:
            self._is_granting = True
            loop.call_soon(self._grant, loop)
        await mine

    def _grant(self, loop: asyncio.AbstractEventLoop) -> None:
        for _ in range(min(self._turns_a_round, len(self._waiting))):
            next_one = self._waiting.popleft()
            if not next_one.done():  # not cancelled
                next_one.set_result(None)
        self._is_granting = bool(self._waiting)
        if self._is_granting:
            loop.call_soon(self._grant, loop)


class Writer:
    """Turns of one client's writer."""

    def __init__(self, bulk: BulkTurns) -> None:
        self._bulk = bulk
        self._spent_s = 0.0
        self._owed_s = 0.0
        self._last_s = bulk.now_s()
        bulk.num_clients += 1

    def close(self) -> None:
        """Removes the client."""
        self._bulk.num_clients -= 1

    async def begin(self) -> None:
        """Waits until the client's writer may send."""
        if self._is_sent_much():
            await self._bulk.turn()

    async def spend(self, cost_s: float) -> None:
        """Adds the cost of a frame; waits if it is the turn of others."""
        self._owed_s = min(self._owed_s + cost_s, _MOST_OWED_S)
        self._spent_s += cost_s
        if self._spent_s >= TURN_S:
            self._spent_s = 0.0
            await (self._bulk.turn() if self._is_sent_much() else asyncio.sleep(0))

    def _is_sent_much(self) -> bool:
        now_s = self._bulk.now_s()
        paid_s = (now_s - self._last_s) * FRACTION / self._bulk.num_clients
        self._owed_s, self._last_s = max(0.0, self._owed_s - paid_s), now_s
        return self._owed_s > CREDIT_S
