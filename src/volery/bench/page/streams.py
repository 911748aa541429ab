"""What a client asks for, and what it lost of it."""

from __future__ import annotations

import json

import numpy as np


def subscription(topic: str) -> str:
    """What subscribes to all messages of a topic."""
    return json.dumps({"op": "subscribe", "topic": topic, "queue_length": 100})


def lost(stamps: list[int]) -> int:
    """How many messages of a periodic topic are missing between the first and the last."""
    steps = np.diff(stamps)
    if steps.size == 0:
        return 0
    return int(np.rint(steps / np.median(steps)).sum()) - steps.size
