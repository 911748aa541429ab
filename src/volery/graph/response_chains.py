"""Detects nodes that respond to each other, or to themselves, endlessly."""

from __future__ import annotations

import logging

from volery.core.errors import NodeError
from volery.graph.messages import Published
from volery.graph.topics import Publisher, Topic

_log = logging.getLogger(__name__)

MAX_RESPONSES_IN_A_ROW = 10_000
"""Maximum length of a chain of messages at one simulated instant, each published in response to the
previous one; a longer chain means that nodes respond to each other, or to themselves, endlessly."""
_MAX_RESPONSES_AT_ONCE = 1_000_000
"""Maximum number of responses on one topic at one simulated instant, where several nodes respond to
each message."""
_RESPONSES_NAMED = 50


class ResponseChains:
    """Checks messages that are published in response to other ones at one simulated instant."""

    def __init__(self) -> None:
        self._endless: set[tuple[str, str]] = set()
        """Topics and nodes of the last messages of a chain that is almost too long."""

    def is_endless(
        self, sender: Publisher, topic: Topic, published: Published, length: int, client: str
    ) -> bool:
        """Returns whether a message has to be dropped, as `client` caused an endless chain.

        length: number of messages of the chain before it. Raises `NodeError` if no client caused
        the chain (`client` is empty).
        """
        topic.answers = topic.answers + 1 if topic.answer_ns == published.time_ns else 1
        topic.answer_ns = published.time_ns
        if length > MAX_RESPONSES_IN_A_ROW - _RESPONSES_NAMED:
            self._endless.add((published.topic, sender.owner))
        if length <= MAX_RESPONSES_IN_A_ROW and topic.answers <= _MAX_RESPONSES_AT_ONCE:
            return False
        named = {*self._endless, (published.topic, sender.owner)}
        self._endless.clear()
        topics = ", ".join(sorted({f"'{name}'" for name, _ in named}))
        nodes = ", ".join(sorted({owner for _, owner in named if owner})) or "callbacks"
        reason = (
            f"messages trigger each other endlessly at {published.time_ns / 1e9:.3f} s: "
            f"on {topics}, published by {nodes}; publish later, from a timer, or not at all"
        )
        if not client:
            raise NodeError(reason)
        _log.warning("%s (started by %s): the remaining messages are dropped", reason, client)
        return True
