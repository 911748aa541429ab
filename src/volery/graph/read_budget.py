"""Limits the time that reading from and writing to external clients may take.

Decoders hold the GIL, which the simulation's thread needs too. So a client is charged the CPU time
of its messages, and a client beyond its share is not read from until time has paid for it: its
socket fills, and the client waits. When the simulation is late, writing to clients is limited too,
and messages wait in bounded queues. All clients together get a fraction of wall time, in equal
shares among those that are over their credit. A client within its share never waits.
"""

from __future__ import annotations

import time
from collections.abc import Callable

MAX_FRACTION = 0.5
"""Fraction of wall time, where the simulation achieves its real-time factor."""
BUSY_FRACTION = 0.05
"""Fraction where it does not, or runs as fast as possible."""
WRITE_FRACTION = 0.3
"""Fraction for writing where the simulation is late; otherwise writing is not limited."""
_NOT_HELD = 100.0
CREDIT_S = 0.05
"""CPU time that a client may use in advance."""
MAX_DEBT_S = 0.1
"""Maximum debt beyond the credit; a single client waits two seconds at most."""
MAX_WAITING = 100
"""Commands of one client that the simulation has not processed; beyond, the client is not read
from.

Later commands of other clients wait behind them, in the order of arrival.
"""
MAX_WAITING_BYTES = 32 * 1024 * 1024
"""Approximate bytes of such commands: all that were read since none was waiting."""
FRAME_S = 50e-6
"""Cost of a frame before decoding: wake-up, framing, a task's turn."""
BYTE_S = 1e-9
"""Cost of each byte before decoding: about four copies."""

_LONGEST_PAUSE_S = 0.25
"""After this time the rate is evaluated again."""
_FULL_PAUSE_S = 0.005
"""Between two checks whether the simulation has processed enough."""


class ReadBudgets:
    """Shares of all clients of a gateway.

    is_busy: returns whether the simulation has no time to spare; called from any thread. fraction,
    busy_fraction: of wall time, for all clients together, and when busy.
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
        """Returns the budget of another client."""
        return ReadBudget(self)

    @property
    def now_s(self) -> float:
        """Wall time, s."""
        return self._now_s()

    @property
    def rate(self) -> float:
        """CPU seconds that a client earns each second of wall time."""
        fraction = self._busy_fraction if self._is_busy() else self._fraction
        return fraction / max(1, len(self._over))

    def note(self, budget: ReadBudget, *, is_over: bool) -> None:
        """Records whether a client has used more than its credit."""
        (self._over.add if is_over else self._over.discard)(budget)


def write_budgets(is_late: Callable[[], bool]) -> ReadBudgets:
    """Returns the shares for writing to clients.

    is_late: returns whether the simulation is behind its real-time factor.
    """
    return ReadBudgets(is_late, fraction=_NOT_HELD, busy_fraction=WRITE_FRACTION)


class ReadBudget:
    """Debt of one client. Belongs to the thread that reads from the client."""

    def __init__(self, budgets: ReadBudgets) -> None:
        self._budgets = budgets
        self._owed_s = 0.0
        self._last_s = budgets.now_s

    def charge(self, cost_s: float) -> None:
        """Charges the CPU time of a message."""
        self._earn()
        self._owed_s = min(self._owed_s + cost_s, CREDIT_S + MAX_DEBT_S)
        if self._owed_s > CREDIT_S:
            self._budgets.note(self, is_over=True)

    def pause_s(self) -> float:
        """Returns how long not to read from the client, s; 0: continue. Check again afterwards."""
        self._earn()
        over_s = self._owed_s - CREDIT_S
        if over_s <= 0.0:
            self._budgets.note(self, is_over=False)
            return 0.0
        return min(over_s / self._budgets.rate, _LONGEST_PAUSE_S)

    def close(self) -> None:
        """Clears the debt of a client that has disconnected."""
        self._owed_s = 0.0
        self._budgets.note(self, is_over=False)

    def _earn(self) -> None:
        now_s = self._budgets.now_s
        earned_s = (now_s - self._last_s) * self._budgets.rate
        self._last_s = now_s
        self._owed_s = max(0.0, self._owed_s - earned_s)


class ReadScope:
    """Budget that a bridge checks before it reads on from a client; see `Session.reading`.

    waiting: returns the number of the client's commands that the simulation has not processed yet.
    """

    def __init__(self, budget: ReadBudget, waiting: Callable[[], int]) -> None:
        self._budget = budget
        self._waiting = waiting
        self._began_s = 0.0
        self._unsettled_bytes = 0

    def begin(self) -> None:
        """Starts measuring decoding, in the thread that continues until `end`."""
        self._began_s = time.thread_time()

    def end(self, frames: int, size: int) -> float:
        """Charges the client for the time since `begin`, and for the given frames and bytes.

        Returns the charge in s.
        """
        spent_s = time.thread_time() - self._began_s
        cost_s = spent_s + frames * FRAME_S + size * BYTE_S
        self._budget.charge(cost_s)
        self._unsettled_bytes += size
        return cost_s

    def pause_s(self) -> float:
        """Returns how long not to read from the client, s; 0: continue. Check again afterwards."""
        waiting = self._waiting()
        if not waiting:
            self._unsettled_bytes = 0
        if waiting > MAX_WAITING or self._unsettled_bytes > MAX_WAITING_BYTES:
            return _FULL_PAUSE_S
        return self._budget.pause_s()

    def close(self) -> None:
        """Clears the debt of a client that has disconnected."""
        self._budget.close()
        self._waiting = int  # the function before refers to the client
