"""Builds subscriptions and counts lost messages."""

from __future__ import annotations

import json

import numpy as np


def subscription(topic: str) -> str:
    """Returns a request that subscribes to all messages of a topic."""
    return json.dumps({"op": "subscribe", "topic": topic, "queue_length": 100})


def lost(stamps: list[int]) -> int:
    """Returns the number of messages missing between the first and last of a periodic topic."""
    steps = np.diff(stamps)
    if steps.size == 0:
        return 0
    return int(np.rint(steps / np.median(steps)).sum()) - steps.size
