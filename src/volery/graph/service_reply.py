"""The answer to a service request, on its way."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError


class ServiceReply:
    """One answer: a response or a failure, once, from any thread.

    Whoever waits for it is told in the thread that answers.
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
        """Whether it has been answered."""
        return self._done

    def answer(self, response: Any) -> None:
        """Give the response; nothing happens if there was an answer before."""
        if self._finish():
            self._on_response(response)

    def fail(self, error: GraphError) -> None:
        """Say that there will be no response; nothing happens if there was an answer before."""
        if self._finish():
            self._on_failure(error)

    def when_done(self, callback: Callable[[], None]) -> None:
        """Call `callback` before the answer is handed out; at once if it has been."""
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
