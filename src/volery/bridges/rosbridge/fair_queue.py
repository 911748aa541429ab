"""Schedules the work for the clients of one asyncio loop: equal shares, in short rounds.

    flow = queue.flow(REQUESTS)
    await flow.begin()
    ...                         # process a frame of the client, or make one for it
    await flow.spend(cost_s)    # returns when the client may continue

A loop runs all ready callbacks in order, so an answer to one client would wait, at each of its
steps, for the frames of all others. In one round of the loop clients therefore get `ROUND_S`
together; the others wait, and the one whose turn would end first, for what it has received and
its weight, goes first (self-clocked fair queueing: Golestani, 1994). A client with little traffic
is ahead of those with much.

The simulation's thread needs Python's lock too, several times in each step, and waits for a switch
interval each time while the loop is busy. So a loop that sends the messages of topics to a crowd of
clients pauses now and then. Otherwise it never idles because of the queue.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools

REQUESTS, MESSAGES = 8.0, 1.0
"""Weights: of requests and their answers, for which a client waits, and of the messages of topics,
of which a slow client loses some (modelling choice)."""
TURN_S = 0.3e-3
"""CPU time of a client's frames after which waiting clients have their turn."""
ROUND_S = 2e-3
"""CPU time of the frames of all clients in one round of the loop; the last frame may exceed it."""
CROWD = 16
"""Waiting clients beyond which the messages of topics pause."""
BUSY_S, PAUSE_S = 2e-3, 1e-3
"""Wall time between two pauses, and of each."""
_SMOOTHING = 0.1
"""Weight of a turn in the mean cost of turns."""
_MIN_TURN_S = 1e-5
_MIN_TURNS = 16
"""Turns granted in a round at least: many may cost nothing."""

_Key = tuple[float, int]
"""Virtual time at which a turn is expected to end, s, and its number in order of arrival."""
_Waiting = list[tuple[_Key, asyncio.Future[None]]]


class FairQueue:
    """Queue of the clients of one loop. For one thread."""

    def __init__(self) -> None:
        self.virtual_s = 0.0
        """Virtual time: start of the newest turn. A client's turns extend over their cost."""
        self._numbers = itertools.count()
        self._waiting: dict[float, _Waiting] = {REQUESTS: [], MESSAGES: []}
        self._num_granted = 0
        """Turns that have been granted and have not started yet."""
        self._round_s = 0.0
        self._turn_s = TURN_S
        """Mean cost of a turn."""
        self._is_scheduled = False
        self._is_paused = False
        self._busy_since_s: float | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def flow(self, weight: float) -> Flow:
        """Returns turns of a client, of which each has a share in proportion to its weight."""
        return Flow(self, weight)

    @property
    def is_full(self) -> bool:
        """Whether this round's time is used up."""
        return self._round_s >= ROUND_S

    def must_wait(self, weight: float) -> bool:
        """Returns whether others have their turn first: this round's time is used, or they wait."""
        if self.is_full or self._num_granted or self._waiting[REQUESTS]:
            return True
        return bool(weight == MESSAGES and (self._is_paused or self._waiting[MESSAGES]))

    async def turn(self, start_s: float, weight: float, cost_s: float | None) -> None:
        """Waits for a turn that starts at a virtual time; used by `Flow`."""
        if self.must_wait(weight):
            cost_s = self._turn_s if cost_s is None else cost_s
            key = (start_s + cost_s / weight, next(self._numbers))
            await self._wait(key, weight)
            while self.is_full:  # others were quicker; the key goes first next time
                await self._wait(key, weight)
        self.virtual_s = max(self.virtual_s, start_s)

    def spend(self, cost_s: float) -> None:
        """Adds the cost of a frame to this round; used by `Flow`."""
        self._round_s += cost_s
        self._schedule()

    def note_turn(self, cost_s: float) -> None:
        """Notes the cost of a whole turn; used by `Flow`."""
        self._turn_s += _SMOOTHING * (cost_s - self._turn_s)

    async def _wait(self, key: _Key, weight: float) -> None:
        granted = self._schedule().create_future()
        heapq.heappush(self._waiting[weight], (key, granted))
        try:
            await granted
        finally:
            if granted.done() and not granted.cancelled():
                self._num_granted -= 1

    def _schedule(self) -> asyncio.AbstractEventLoop:
        """Lets the next round begin after this one; returns the loop."""
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
        if not self._is_scheduled:
            self._is_scheduled = True
            self._loop.call_soon(self._begin_round)
        return self._loop

    def _begin_round(self) -> None:
        """Grants as many turns as a round has time for; those that find no time wait again."""
        self._is_scheduled = False
        self._round_s = 0.0
        self._pause_in_crowds()
        num_turns = max(_MIN_TURNS, int(ROUND_S / max(self._turn_s, _MIN_TURN_S)))
        while self._num_granted < num_turns and (waiting := self._next()):
            _, granted = heapq.heappop(waiting)
            if not granted.done():  # not cancelled
                granted.set_result(None)
                self._num_granted += 1
        if self._next():
            self._schedule()

    def _next(self) -> _Waiting | None:
        """Returns the queue of those that wait whose first one has the next turn."""
        requests, messages = self._waiting[REQUESTS], self._waiting[MESSAGES]
        if messages and not self._is_paused and (not requests or messages[0] < requests[0]):
            return messages
        return requests or None

    def _pause_in_crowds(self) -> None:
        assert self._loop is not None
        if self._is_paused:
            return
        now_s = self._loop.time()
        if len(self._waiting[MESSAGES]) <= CROWD:
            self._busy_since_s = None
        elif self._busy_since_s is None:
            self._busy_since_s = now_s
        elif now_s - self._busy_since_s >= BUSY_S:
            self._is_paused = True
            self._busy_since_s = None
            self._loop.call_later(PAUSE_S, self._end_pause)

    def _end_pause(self) -> None:
        self._is_paused = False
        self._schedule()


class Flow:
    """Turns of one client, of one kind."""

    def __init__(self, queue: FairQueue, weight: float) -> None:
        self._queue = queue
        self._weight = weight
        self._end_s = 0.0
        """Virtual time at which the client's next turn may start."""
        self._turn_s = 0.0

    async def begin(self, cost_s: float | None = None) -> None:
        """Waits until it is the client's turn.

        cost_s: expected cost of the turn; None: that of others.
        """
        queue = self._queue
        if self._turn_s:
            queue.note_turn(self._turn_s)
            self._turn_s = 0.0
        self._end_s = max(self._end_s, queue.virtual_s)
        await queue.turn(self._end_s, self._weight, cost_s)

    def charge(self, cost_s: float) -> None:
        """Adds the cost of a frame, s of CPU time, to a turn that ends."""
        self._turn_s += cost_s
        self._end_s += cost_s / self._weight
        self._queue.spend(cost_s)

    async def spend(self, cost_s: float) -> None:
        """Adds the cost of a frame, s of CPU time; waits if it is the turn of others."""
        self.charge(cost_s)
        if self._queue.is_full or (self._turn_s >= TURN_S and self._queue.must_wait(self._weight)):
            await self.begin()
