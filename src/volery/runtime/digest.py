"""A fingerprint of a run: SHA-256 over all states and all sensor messages."""

from __future__ import annotations

import hashlib

import numpy as np

from volery.graph.messages import Published
from volery.vehicle.pose_history import PoseHistory


class Digest:
    """Takes in the pose of every UAV after every physics step, and every message's CDR bytes."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add_steps(self, history: PoseHistory, first_step: int, last_step: int) -> None:
        """Take in the poses after steps first..last, which the history must still hold."""
        rows = np.arange(first_step, last_step + 1) % len(history.position)
        for row in rows:
            self._hash.update(history.position[row].tobytes())
            self._hash.update(history.attitude[row].tobytes())

    def add_message(self, published: Published) -> None:
        """Take in a message with its topic and time."""
        self._hash.update(f"{published.topic} {published.time_ns}".encode())
        self._hash.update(published.cdr)

    def hexdigest(self) -> str:
        """Digest of what was taken in so far."""
        return self._hash.hexdigest()
