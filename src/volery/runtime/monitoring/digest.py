"""Fingerprints of a run: SHA-256 over all states and all messages.

Poses are taken in after every physics step, all other states of the plant and the flight mode each
time `add_states` is called, which must be on a grid of simulated time.

One digest takes everything in the order in which it came. A second one is the same for two runs in
which each topic carried the same, whatever the order between topics at one instant: a node outside
in lock step publishes later within an instant than the same node inside.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.graph.messages import Published
from volery.vehicle.pose_history import PoseHistory


class Digest:
    """Takes in states and the CDR bytes of messages."""

    def __init__(self) -> None:
        self.set_state(None)

    def add_steps(self, history: PoseHistory, first_step: int, last_step: int) -> None:
        """Take in the poses after steps first..last, which the history must still hold."""
        rows = np.arange(first_step, last_step + 1) % len(history.position)
        for row in rows:
            self._add_state(history.position[row].tobytes())
            self._add_state(history.attitude[row].tobytes())

    def add_states(self, fleet: Fleet) -> None:
        """Take in velocities, rates, rotor speeds, contacts, modes and the like as they are."""
        for array in fleet.state:
            self._add_state(np.ascontiguousarray(array).tobytes())
        self._add_state(bytes(int(fleet.mode(i)) for i in range(len(fleet))))

    def add_message(self, published: Published) -> None:
        """Take in a message with its topic and time."""
        head = f"{published.topic} {published.time_ns}".encode()
        topic = self._topics.setdefault(published.topic, hashlib.sha256())
        for part in (head, published.cdr):
            self._hash.update(part)
            topic.update(part)

    def get_state(self) -> Any:
        """What a snapshot keeps."""
        topics = {name: part.copy() for name, part in self._topics.items()}
        return self._hash.copy(), self._states.copy(), topics

    def set_state(self, state: Any) -> None:
        """Go back to a kept state; None is that before anything was taken in."""
        whole, states, topics = state or (hashlib.sha256(), hashlib.sha256(), {})
        self._hash, self._states = whole.copy(), states.copy()
        self._topics = {name: part.copy() for name, part in topics.items()}

    def hexdigest(self) -> str:
        """Digest of what was taken in so far, in its order."""
        return self._hash.hexdigest()

    def hexdigest_by_topic(self) -> str:
        """Digest of the states and of each topic, whatever the order between topics."""
        joined = self._states.copy()
        for name, part in sorted(self._topics.items()):
            joined.update(name.encode())
            joined.update(part.digest())
        return joined.hexdigest()

    def _add_state(self, data: bytes) -> None:
        self._hash.update(data)
        self._states.update(data)
