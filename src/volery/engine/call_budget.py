"""How much of the simulation's thread the calls of external clients may take.

All clients together get a fraction of its time, in equal shares among those that owe something:
what one has spent and not earned back yet. A client that owes more than its credit waits for its
turn; the calls of others are not delayed by that.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable

MAX_FRACTION = 0.05
"""Of wall time, for all clients together, where the simulation has no time to spare."""
_CREDIT_S = 0.05
"""What clients may spend in advance, in equal shares among those that owe something."""
_MIN_CREDIT_S = 0.002
_MAX_DEBT_S = 0.05
"""Beyond the credit: after one long call a client alone waits a second, not minutes."""
_PAY_PERIOD_S = 0.002


class CallBudget:
    """What each client owes, in seconds of CPU time; it belongs to the simulation's thread."""

    def __init__(self, now_s: Callable[[], float] = time.perf_counter) -> None:
        self._now_s = now_s
        self._last_s = now_s()
        self._owed_s: dict[Hashable, float] = {}

    def earn(self) -> bool:
        """Let wall time that has passed pay for what clients owe, in equal shares.

        Returns whether it did: not where hardly any has passed.
        """
        now_s = self._now_s()
        if now_s - self._last_s < _PAY_PERIOD_S:
            return False
        earned_s, self._last_s = MAX_FRACTION * (now_s - self._last_s), now_s
        for left, (client, owed_s) in enumerate(
            sorted(self._owed_s.items(), key=lambda item: item[1]), start=-len(self._owed_s)
        ):
            share_s = earned_s / -left  # what those that owe less did not need goes to the others
            paid_s = min(share_s, owed_s)
            earned_s -= paid_s
            if paid_s == owed_s:
                del self._owed_s[client]
            else:
                self._owed_s[client] = owed_s - paid_s
        return True

    def may_spend(self, client: Hashable) -> bool:
        """Whether the client's next call may run now."""
        return self._owed_s.get(client, 0.0) < self._credit_s

    def spend(self, client: Hashable, cost_s: float) -> None:
        """Charge a client for CPU time of the simulation's thread, or pay some back."""
        owed_s = min(self._owed_s.get(client, 0.0) + cost_s, self._credit_s + _MAX_DEBT_S)
        if owed_s > 0.0:
            self._owed_s[client] = owed_s
        else:
            self._owed_s.pop(client, None)

    @property
    def _credit_s(self) -> float:
        return max(_CREDIT_S / max(1, len(self._owed_s)), _MIN_CREDIT_S)
