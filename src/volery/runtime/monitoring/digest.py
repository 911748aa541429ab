"""Computes fingerprints of a run: SHA-256 over all states and all messages.

Poses enter after every physics step; all other states of the plant and the flight mode enter at
each call of `add_states`, which must be on a grid of simulated time.

One digest depends on the order of all data. A second one is equal for two runs if each topic
carried the same messages, whatever the order between topics at one instant: an external node in
lock step publishes later within an instant than the same node inside the simulation.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.graph.messages import Published
from volery.vehicle.pose_history import PoseHistory


class Digest:
    """Hashes states and the CDR bytes of messages."""

    def __init__(self) -> None:
        self.set_state(None)

    def add_steps(self, history: PoseHistory, first_step: int, last_step: int) -> None:
        """Hashes the poses after steps first..last, which the history must still contain."""
        rows = np.arange(first_step, last_step + 1) % len(history.position)
        for row in rows:
            self._add_state(history.position[row].tobytes())
            self._add_state(history.attitude[row].tobytes())

    def add_states(self, fleet: Fleet) -> None:
        """Hashes the present velocities, rates, rotor speeds, contacts, modes and other states."""
        for array in fleet.state:
            self._add_state(np.ascontiguousarray(array).tobytes())
        self._add_state(bytes(int(fleet.mode(i)) for i in range(len(fleet))))

    def add_message(self, published: Published) -> None:
        """Hashes a message with its topic and time."""
        head = f"{published.topic} {published.time_ns}".encode()
        topic = self._topics.setdefault(published.topic, hashlib.sha256())
        for part in (head, published.cdr):
            self._hash.update(part)
            topic.update(part)

    def get_state(self) -> Any:
        """Returns the state for a snapshot."""
        topics = {name: part.copy() for name, part in self._topics.items()}
        return self._hash.copy(), self._states.copy(), topics

    def set_state(self, state: Any) -> None:
        """Restores a saved state; None clears all hashes."""
        whole, states, topics = state or (hashlib.sha256(), hashlib.sha256(), {})
        self._hash, self._states = whole.copy(), states.copy()
        self._topics = {name: part.copy() for name, part in topics.items()}

    def hexdigest(self) -> str:
        """Returns the digest of all data so far, in their order."""
        return self._hash.hexdigest()

    def hexdigest_by_topic(self) -> str:
        """Returns the digest of the states and of each topic, whatever the order between topics."""
        joined = self._states.copy()
        for name, part in sorted(self._topics.items()):
            joined.update(name.encode())
            joined.update(part.digest())
        return joined.hexdigest()

    def _add_state(self, data: bytes) -> None:
        self._hash.update(data)
        self._states.update(data)
