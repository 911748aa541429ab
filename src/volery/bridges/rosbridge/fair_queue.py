"""Schedules the work for the clients of one asyncio loop: equal shares, in short rounds.

    flow = queue.flow(REQUESTS)
    await flow.begin()
    ...                         # process a frame of the client, or make one for it
    await flow.spend(cost_s)    # returns when the client may continue

A loop runs all ready callbacks in order, so an answer to one client would wait, at each of its
steps, for the frames of all others. In one round of the loop clients therefore get `ROUND_S`
together; the others wait, and the one that has received the least for its weight goes first
(start-time fair queueing: Goyal, Vin and Cheng, 1996). A client with little traffic is ahead of
those with much, and behind no more than one turn of each client that begins at the same time. The
loop never idles because of it.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools

TURN_S = 0.3e-3
"""CPU time of a client's frames after which waiting clients have their turn."""
ROUND_S = 2e-3
"""CPU time of the frames of all clients in one round of the loop; the last frame may exceed it."""
REQUESTS = 8.0
"""Weight of requests and their answers, for which a client waits; that of the messages of topics,
of which a slow client loses some, is 1 (modelling choice)."""
_SMOOTHING = 0.1
"""Weight of a turn in the mean cost of turns."""
_MIN_TURN_S = 1e-5

_Key = tuple[float, int]
"""Virtual time at which a turn starts, s, and its number in order of arrival."""


class FairQueue:
    """Queue of the clients of one loop. For one thread."""

    def __init__(self) -> None:
        self.virtual_s = 0.0
        """Virtual time: start of the newest turn. A client's turns extend over their cost."""
        self._numbers = itertools.count()
        self._waiting: list[tuple[_Key, asyncio.Future[None]]] = []
        self._num_granted = 0
        """Turns that have been granted and have not started yet."""
        self._round_s = 0.0
        self._turn_s = TURN_S
        """Mean cost of a turn."""
        self._is_scheduled = False

    def flow(self, weight: float = 1.0) -> Flow:
        """Returns turns of a client, of which each has a share in proportion to its weight."""
        return Flow(self, weight)

    @property
    def has_waiting(self) -> bool:
        """Whether a client waits for its turn."""
        return bool(self._waiting or self._num_granted)

    @property
    def is_full(self) -> bool:
        """Whether this round's time is used up."""
        return self._round_s >= ROUND_S

    async def turn(self, start_s: float) -> None:
        """Waits for a turn that starts at a virtual time; used by `Flow`."""
        if self.is_full or self.has_waiting:
            key = (start_s, next(self._numbers))
            await self._wait(key)
            while self.is_full:
                await self._wait(key)
        self.virtual_s = max(self.virtual_s, start_s)

    def spend(self, cost_s: float) -> None:
        """Adds the cost of a frame to this round; used by `Flow`."""
        self._round_s += cost_s
        self._schedule()

    def note_turn(self, cost_s: float) -> None:
        """Notes the cost of a whole turn; used by `Flow`."""
        self._turn_s += _SMOOTHING * (cost_s - self._turn_s)

    async def _wait(self, key: _Key) -> None:
        loop = asyncio.get_running_loop()
        granted = loop.create_future()
        heapq.heappush(self._waiting, (key, granted))
        self._schedule()
        try:
            await granted
        finally:
            if granted.done() and not granted.cancelled():
                self._num_granted -= 1

    def _schedule(self) -> None:
        if not self._is_scheduled:
            self._is_scheduled = True
            asyncio.get_running_loop().call_soon(self._begin_round)

    def _begin_round(self) -> None:
        """Grants as many turns as a round has time for; those that find no time wait again."""
        self._round_s = 0.0
        num_turns = max(1, int(ROUND_S / max(self._turn_s, _MIN_TURN_S)))
        while self._waiting and self._num_granted < num_turns:
            _, granted = heapq.heappop(self._waiting)
            if not granted.done():  # not cancelled
                granted.set_result(None)
                self._num_granted += 1
        self._is_scheduled = False
        if self._waiting:
            self._schedule()


class Flow:
    """Turns of one client, of one kind."""

    def __init__(self, queue: FairQueue, weight: float) -> None:
        self._queue = queue
        self._weight = weight
        self._end_s = 0.0
        """Virtual time at which the client's next turn may start."""
        self._turn_s = 0.0

    async def begin(self) -> None:
        """Waits until it is the client's turn."""
        queue = self._queue
        if self._turn_s:
            queue.note_turn(self._turn_s)
            self._turn_s = 0.0
        self._end_s = max(self._end_s, queue.virtual_s)
        await queue.turn(self._end_s)

    async def spend(self, cost_s: float) -> None:
        """Adds the cost of a frame, s of CPU time; waits if it is the turn of others."""
        queue = self._queue
        self._turn_s += cost_s
        self._end_s += cost_s / self._weight
        queue.spend(cost_s)
        if queue.is_full or (self._turn_s >= TURN_S and queue.has_waiting):
            await self.begin()
