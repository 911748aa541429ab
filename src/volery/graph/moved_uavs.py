"""States which UAVs a topic or service moves, where its name does not say.

The receiver of the messages or requests declares it: `/mavros/cmd/land` moves `uav1`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable


class MovedUavs:
    """The UAVs that the topics and services of one graph move; for any thread."""

    def __init__(self) -> None:
        self._declared: dict[str, tuple[str, ...]] = {}
        self._lock = threading.Lock()

    def of(self, name: str) -> frozenset[str]:
        """Returns the UAVs that are declared for a topic or service, by its absolute name."""
        return frozenset(self._declared.get(name, ()))

    def declare(self, name: str, uavs: Iterable[str]) -> Callable[[], None]:
        """Declares that messages or requests to `name` move `uavs`; returns what withdraws it."""
        own = tuple(uavs)
        with self._lock:
            self._declared[name] = (*self._declared.get(name, ()), *own)

        def withdraw() -> None:
            with self._lock:
                left = list(self._declared.get(name, ()))
                for uav in own:
                    if uav in left:
                        left.remove(uav)
                if left:
                    self._declared[name] = tuple(left)
                else:
                    self._declared.pop(name, None)

        return withdraw
