"""A fingerprint of a run: SHA-256 over all states and all messages.

Poses are taken in after every physics step, all other states of the plant and the flight mode each
time `add_states` is called, which must be on a grid of simulated time.
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
        self._hash = hashlib.sha256()

    def add_steps(self, history: PoseHistory, first_step: int, last_step: int) -> None:
        """Take in the poses after steps first..last, which the history must still hold."""
        rows = np.arange(first_step, last_step + 1) % len(history.position)
        for row in rows:
            self._hash.update(history.position[row].tobytes())
            self._hash.update(history.attitude[row].tobytes())

    def add_states(self, fleet: Fleet) -> None:
        """Take in velocities, rates, rotor speeds, contacts, modes and the like as they are."""
        for array in fleet.state:
            self._hash.update(np.ascontiguousarray(array).tobytes())
        self._hash.update(bytes(int(fleet.mode(i)) for i in range(len(fleet))))

    def add_message(self, published: Published) -> None:
        """Take in a message with its topic and time.

        Below `/volery/` is told how a run is watched and steered, some of it in wall time.
        """
        if published.topic.startswith("/volery/"):
            return
        self._hash.update(f"{published.topic} {published.time_ns}".encode())
        self._hash.update(published.cdr)

    def get_state(self) -> Any:
        """What a snapshot keeps."""
        return self._hash.copy()

    def set_state(self, state: Any) -> None:
        """Go back to a kept state; None is that before anything was taken in."""
        self._hash = hashlib.sha256() if state is None else state.copy()

    def hexdigest(self) -> str:
        """Digest of what was taken in so far."""
        return self._hash.hexdigest()
