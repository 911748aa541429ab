"""Limits the time that calls of external clients may take of the simulation's thread.

All clients together get a fraction of its time, in equal shares among those in debt: that have used
more than they have earned. A client whose debt exceeds its credit waits for its turn, which does
not delay the calls of others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable

MAX_FRACTION = 0.05
"""Fraction of wall time for all clients together, when the simulation has no time to spare."""
_CREDIT_S = 0.05
"""CPU time that clients may use in advance, in equal shares among those in debt."""
_MIN_CREDIT_S = 0.002
_MAX_DEBT_S = 0.05
"""Maximum debt beyond the credit: after one long call a single client waits a second, not
minutes."""
_PAY_PERIOD_S = 0.002


class CallBudget:
    """Debt of each client, s of CPU time; used in the simulation's thread."""

    def __init__(self, now_s: Callable[[], float] = time.perf_counter) -> None:
        self._now_s = now_s
        self._last_s = now_s()
        self._owed_s: dict[Hashable, float] = {}

    def earn(self) -> bool:
        """Pays the clients' debts with the wall time that has passed, in equal shares.

        Returns False if too little time has passed to pay.
        """
        now_s = self._now_s()
        if now_s - self._last_s < _PAY_PERIOD_S:
            return False
        earned_s, self._last_s = MAX_FRACTION * (now_s - self._last_s), now_s
        for left, (client, owed_s) in enumerate(
            sorted(self._owed_s.items(), key=lambda item: item[1]), start=-len(self._owed_s)
        ):
            part_s = earned_s / -left  # unused shares go to the others
            paid_s = min(part_s, owed_s)
            earned_s -= paid_s
            if paid_s == owed_s:
                del self._owed_s[client]
            else:
                self._owed_s[client] = owed_s - paid_s
        return True

    def may_spend(self, client: Hashable) -> bool:
        """Returns whether the client's next call may run now."""
        return self._owed_s.get(client, 0.0) < self._credit_s

    def spend(self, client: Hashable, cost_s: float) -> None:
        """Charges a client CPU time of the simulation's thread; a negative cost is refunded."""
        owed_s = min(self._owed_s.get(client, 0.0) + cost_s, self._credit_s + _MAX_DEBT_S)
        if owed_s > 0.0:
            self._owed_s[client] = owed_s
        else:
            self._owed_s.pop(client, None)

    @property
    def _credit_s(self) -> float:
        return max(_CREDIT_S / max(1, len(self._owed_s)), _MIN_CREDIT_S)
