"""Queues commands of other threads, which the engine executes between two ticks only."""

from __future__ import annotations

import heapq
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from typing import Any, NamedTuple, Protocol

from volery.core.errors import CommandError
from volery.engine.call_budget import CallBudget

_MAX_ROUND_COMMANDS = 32
"""Limit of one client's commands per round without time to spare: then their effects are
charged."""
_MAX_ROUND_S = 0.02
"""Limit of the CPU time of clients' commands between two ticks without time to spare."""


class CommandTime(NamedTuple):
    """Moment of a command, independent of how the run is divided.

    turn: number of ticks, barriers with partners and rounds of commands since the physics step.
    """

    step: int
    turn: int


class Repeats(Protocol):
    """Replays recorded commands at their moments."""

    def next_step(self) -> int | None:
        """Returns the physics step of the next command, None after the last one."""

    def take(self) -> bool:
        """Executes the commands of the engine's current moment; returns whether there were any."""


class _Command(NamedTuple):
    number: int
    """Number among all posted commands, in order of arrival."""
    action: Callable[[], Any]
    future: Future[Any]


class ClientQueue:
    """Commands of one external client, executed in order; client `None`: all other commands."""

    def __init__(self, inbox: CommandQueue, client: Hashable = None) -> None:
        self._inbox = inbox
        self.client = client
        self.commands: deque[_Command] = deque()
        self.is_deferred = False
        """Whether the client waits for its turn because its budget is used up."""
        self.after_s = 0.0
        """Expected CPU time after a command, for its publications, s."""

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Runs `action()` before a tick; the future holds its result or error."""
        return self._inbox.put(self, action)


class CommandQueue:
    """Executes posted commands in the engine's thread; any thread may post.

    Commands run in order of arrival. Those of an external client (`open_queue`) are charged to the
    client by CPU time; when the engine has no time to spare, a client whose budget is used up waits
    for its turn (`engine.call_budget`). Code that runs in the engine's thread between ticks (nodes,
    a user's script) commands the fleet directly: its commands take effect with the next physics
    step too.

    on_post: called, in the thread that posts, after each command.
    """

    def __init__(
        self,
        *,
        on_post: Callable[[], None] | None = None,
        cpu_s: Callable[[], float] = time.thread_time,
        now_s: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._on_post = on_post or _nothing
        self._budget = CallBudget(now_s)
        self._cpu_s = cpu_s
        self._now_s = now_s
        self._own = ClientQueue(self)
        self._occupied: dict[ClientQueue, None] = {}
        self._next_number = 0
        self._lock = threading.Lock()
        self._news = threading.Event()
        self._closed: str | None = None
        self._charged: list[tuple[ClientQueue, float]] = []
        self._mark_s = 0.0
        self.is_cut = False
        """Whether `work_off` stopped early, so that the effects are delivered and charged first."""

    def open_queue(self) -> ClientQueue:
        """Returns a queue for the commands of one external client."""
        return ClientQueue(self, object())

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Runs `action()` before the next tick; the future holds its result or error."""
        return self._own.post(action)

    def put(self, queue: ClientQueue, action: Callable[[], Any]) -> Future[Any]:
        """Adds a command; used by `ClientQueue`."""
        future: Future[Any] = Future()
        with self._lock:
            closed = self._closed
            if closed is None:
                queue.commands.append(_Command(self._next_number, action, future))
                self._next_number += 1
                self._occupied[queue] = None
        if closed is not None:
            future.set_exception(CommandError(closed))
            return future
        self._news.set()
        self._on_post()
        return future

    def close(self, reason: str) -> None:
        """Rejects waiting and later commands, which fail with `reason`."""
        with self._lock:
            self._closed = reason
            left = [command for queue in self._occupied for command in queue.commands]
            self._occupied.clear()
        for command in sorted(left):
            if command.future.set_running_or_notify_cancel():
                command.future.set_exception(CommandError(reason))

    @property
    def has_waiting(self) -> bool:
        """Whether any command waits, including clients' deferred ones."""
        return bool(self._occupied)

    def wake(self) -> None:
        """Ends a `wait` without a command."""
        self._news.set()

    def wait(self, timeout_s: float) -> None:
        """Waits for a command or `wake`; returns at once if a command waits."""
        if not self._occupied:
            self._news.wait(timeout_s)
        self._news.clear()

    def serve(self, hand_out: Callable[[], None], idle_s: float = math.inf) -> None:
        """Executes the waiting commands whose turn it is, with their effects, in rounds.

        hand_out: delivers what a round has published; the round's clients pay for it. idle_s: see
        `work_off`.
        """
        while self.work_off(idle_s):
            hand_out()
            self.end_round()
            if not self.is_cut:
                return
            idle_s = 0.0

    def work_off(self, idle_s: float = math.inf) -> bool:
        """Executes the waiting commands whose turn it is; returns whether there were any.

        idle_s: wall time to spare; commands in this time are charged to no client.
        """
        if not self._occupied:
            return False
        earned = self._budget.earn()
        with self._lock:
            limit = self._next_number
            if not (earned or idle_s) and all(queue.is_deferred for queue in self._occupied):
                return False
            heads = [_head(queue) for queue in self._occupied]
        heapq.heapify(heads)
        until_s = self._now_s() + idle_s
        worked, round_s = False, 0.0
        called: Counter[ClientQueue] = Counter()
        self.is_cut = False
        while heads:
            queue = heapq.heappop(heads)[-1]
            free = queue.client is None or until_s == math.inf or self._now_s() < until_s
            if not free and (round_s > _MAX_ROUND_S or not self._budget.may_spend(queue.client)):
                queue.is_deferred = True
                continue
            if not free and called[queue] >= _MAX_ROUND_COMMANDS:
                self.is_cut = True
                continue
            command = self._pop(queue, limit)
            if command is None:
                continue
            worked = True
            called[queue] += not free
            round_s += self._call(command, None if free else queue)
            with self._lock:
                if queue.commands and queue.commands[0].number < limit:
                    heapq.heappush(heads, _head(queue))
        self._mark_s = self._cpu_s()
        return worked

    def end_round(self) -> None:
        """Charges the clients of the last `work_off` for the time that has passed since."""
        charged, self._charged = self._charged, []
        if charged:
            each_s = (self._cpu_s() - self._mark_s) / len(charged)
            for queue, expected_s in charged:
                self._budget.spend(queue.client, each_s - expected_s)
                queue.after_s += 0.5 * (each_s - queue.after_s)

    def _pop(self, queue: ClientQueue, limit: int) -> _Command | None:
        """Removes and returns a queue's next command posted before `limit`, None without one."""
        with self._lock:
            if not queue.commands or queue.commands[0].number >= limit:
                return None
            command = queue.commands.popleft()
            if not queue.commands:
                self._occupied.pop(queue, None)
                queue.is_deferred = False
            return command

    def _call(self, command: _Command, payer: ClientQueue | None) -> float:
        """Runs a command and charges `payer`; returns the CPU time with expected effects, s."""
        if not command.future.set_running_or_notify_cancel():
            return 0.0
        before_s = 0.0 if payer is None else self._cpu_s()
        try:
            command.future.set_result(command.action())
        except Exception as error:  # reported to the sender; the engine continues
            command.future.set_exception(error)
        if payer is None:
            return 0.0
        cost_s = self._cpu_s() - before_s + payer.after_s
        self._budget.spend(payer.client, cost_s)
        self._charged.append((payer, payer.after_s))
        return cost_s


def _head(queue: ClientQueue) -> tuple[bool, int, ClientQueue]:
    """Returns the sort key of queues: those not deferred first, then by arrival."""
    return queue.is_deferred, queue.commands[0].number, queue


def _nothing() -> None:
    """Does nothing."""
