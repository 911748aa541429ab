"""How much time of the simulation's process reading and writing may take for external clients.

Decoders hold Python's lock, which the simulation's thread needs, too. So what a client sends is
charged to it by CPU time, and a client beyond its share is read from no more until time has paid
for that: its socket fills, and it waits. Where the simulation is late, writing to clients has its
share, too, and what is published meanwhile waits in bounded queues. All clients together get a
fraction of wall time, in equal shares among those that are over their credit. A client within its
share is never held.
"""

from __future__ import annotations

import time
from collections.abc import Callable

MAX_FRACTION = 0.5
"""Of wall time, where the simulation keeps its pace."""
BUSY_FRACTION = 0.05
"""Where it does not, or runs as fast as it can."""
WRITE_FRACTION = 0.3
"""Where the simulation is late; elsewhere writing is not held."""
_NOT_HELD = 100.0
CREDIT_S = 0.05
"""What a client may spend in advance."""
MAX_DEBT_S = 0.1
"""Beyond the credit; a client alone waits two seconds at most."""
MAX_WAITING = 100
"""Commands of one client that the simulation has not taken yet; beyond, it is not read from.

Those of others that come later wait behind them, in the order of arrival.
"""
MAX_WAITING_BYTES = 32 * 1024 * 1024
"""Of messages that wait like that, roughly: of all that was read since none waited."""
FRAME_S = 50e-6
"""What a frame costs before it is decoded: waking, cutting, a task's turn."""
BYTE_S = 1e-9
"""What each of its bytes costs there: about four copies."""

_LONGEST_PAUSE_S = 0.25
"""After which the pace is looked at anew."""
_FULL_PAUSE_S = 0.005
"""Between two looks whether the simulation has taken enough."""


class ReadBudgets:
    """Shares of all clients of a gateway.

    is_busy: whether the simulation has no time to spare at present; called from any thread.
    fraction, busy_fraction: of wall time, for all clients together, and where it is busy.
    """

    def __init__(
        self,
        is_busy: Callable[[], bool],
        now_s: Callable[[], float] = time.monotonic,
        *,
        fraction: float = MAX_FRACTION,
        busy_fraction: float = BUSY_FRACTION,
    ) -> None:
        self._is_busy = is_busy
        self._fraction = fraction
        self._busy_fraction = busy_fraction
        self._now_s = now_s
        self._over: set[ReadBudget] = set()

    def open(self) -> ReadBudget:
        """Returns the budget of one more client."""
        return ReadBudget(self)

    @property
    def now_s(self) -> float:
        """Wall time."""
        return self._now_s()

    @property
    def rate(self) -> float:
        """CPU seconds that a client earns each second of wall time."""
        fraction = self._busy_fraction if self._is_busy() else self._fraction
        return fraction / max(1, len(self._over))

    def note(self, budget: ReadBudget, *, is_over: bool) -> None:
        """Remember which clients have spent more than their credit."""
        (self._over.add if is_over else self._over.discard)(budget)


def write_budgets(is_late: Callable[[], bool]) -> ReadBudgets:
    """Returns the shares of writing to clients.

    is_late: whether the simulation does not keep its pace.
    """
    return ReadBudgets(is_late, fraction=_NOT_HELD, busy_fraction=WRITE_FRACTION)


class ReadBudget:
    """What one client owes. It belongs to the thread that reads from the client."""

    def __init__(self, budgets: ReadBudgets) -> None:
        self._budgets = budgets
        self._owed_s = 0.0
        self._last_s = budgets.now_s

    def charge(self, cost_s: float) -> None:
        """Note CPU time that the client's message took."""
        self._earn()
        self._owed_s = min(self._owed_s + cost_s, CREDIT_S + MAX_DEBT_S)
        if self._owed_s > CREDIT_S:
            self._budgets.note(self, is_over=True)

    def pause_s(self) -> float:
        """Returns for how long not to read from the client; 0: read on. Ask again afterwards."""
        self._earn()
        over_s = self._owed_s - CREDIT_S
        if over_s <= 0.0:
            self._budgets.note(self, is_over=False)
            return 0.0
        return min(over_s / self._budgets.rate, _LONGEST_PAUSE_S)

    def close(self) -> None:
        """The client has left."""
        self._owed_s = 0.0
        self._budgets.note(self, is_over=False)

    def _earn(self) -> None:
        now_s = self._budgets.now_s
        earned_s = (now_s - self._last_s) * self._budgets.rate
        self._last_s = now_s
        self._owed_s = max(0.0, self._owed_s - earned_s)


class Reading:
    """What a bridge asks before it reads on from a client; see `Session.reading`.

    waiting: how many of the client's commands the simulation has not taken yet.
    """

    def __init__(self, budget: ReadBudget, waiting: Callable[[], int]) -> None:
        self._budget = budget
        self._waiting = waiting
        self._began_s = 0.0
        self._unsettled_bytes = 0

    def begin(self) -> None:
        """Decoding begins, in the thread that goes on with it until `end`."""
        self._began_s = time.thread_time()

    def end(self, frames: int, size: int) -> float:
        """Charge the client for what began, and for taking so many frames and bytes in.

        Returns the charge in s.
        """
        spent_s = time.thread_time() - self._began_s
        cost_s = spent_s + frames * FRAME_S + size * BYTE_S
        self._budget.charge(cost_s)
        self._unsettled_bytes += size
        return cost_s

    def pause_s(self) -> float:
        """Returns for how long not to read from the client; 0: read on. Ask again afterwards."""
        waiting = self._waiting()
        if not waiting:
            self._unsettled_bytes = 0
        if waiting > MAX_WAITING or self._unsettled_bytes > MAX_WAITING_BYTES:
            return _FULL_PAUSE_S
        return self._budget.pause_s()

    def close(self) -> None:
        """The client has left."""
        self._budget.close()
