"""Provides the pending response to a service request."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError


class ServiceReply:
    """One pending response: settled once, by a response or a failure, from any thread.

    The callbacks run in the thread that settles it.
    """

    def __init__(
        self, on_response: Callable[[Any], None], on_failure: Callable[[GraphError], None]
    ) -> None:
        self._on_response = on_response
        self._on_failure = on_failure
        self._lock = threading.Lock()
        self._done = False
        self._afterwards: list[Callable[[], None]] = []

    @property
    def done(self) -> bool:
        """Whether the reply has been settled."""
        return self._done

    def answer(self, response: Any) -> None:
        """Gives the response; has no effect on a settled reply."""
        if self._finish():
            on_response = self._on_response
            self._forget()
            on_response(response)

    def fail(self, error: GraphError) -> None:
        """Gives a failure; has no effect on a settled reply."""
        if self._finish():
            on_failure = self._on_failure
            self._forget()
            on_failure(error)

    def when_done(self, callback: Callable[[], None]) -> None:
        """Calls `callback` before the response is passed on; at once if it has been."""
        with self._lock:
            if not self._done:
                self._afterwards.append(callback)
                return
        callback()

    def _finish(self) -> bool:
        with self._lock:
            if self._done:
                return False
            self._done = True
        for callback in self._afterwards:
            callback()
        return True

    def _forget(self) -> None:
        """Drops the callbacks, which often refer to the reply: its memory is free at once."""
        self._afterwards.clear()
        self._on_response = self._on_failure = _ignore


def _ignore(_what: object) -> None:
    """Does nothing."""
