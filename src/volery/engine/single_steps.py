"""Manages the requested single steps of a paused run."""

from __future__ import annotations

from collections.abc import Callable

OnSteps = Callable[["StepRequest"], None]
"""Called after each piece of a request and at its end, in the thread that ran or ended it."""


class StepRequest:
    """Request of `steps` physics steps while paused; only `Pacer` modifies it."""

    def __init__(self, steps: int, on_steps: OnSteps | None = None) -> None:
        self.steps = steps
        self.made = 0
        """Number of steps that have been run."""
        self.reason = ""
        """Reason why the request ended early; empty otherwise."""
        self._on_steps = on_steps

    @property
    def left(self) -> int:
        """Number of steps that are left, or were at an early end."""
        return self.steps - self.made

    @property
    def over(self) -> bool:
        """Whether the request has ended."""
        return self.left == 0 or bool(self.reason)

    def notify(self) -> None:
        """Calls the request's callback; called without locks held."""
        if self._on_steps is not None:
            self._on_steps(self)


class StepQueue:
    """Requests in order of arrival. Not thread-safe: the owner locks."""

    def __init__(self) -> None:
        self._waiting: list[StepRequest] = []

    def __bool__(self) -> bool:
        """Returns whether steps are pending."""
        return bool(self._waiting)

    def add(self, request: StepRequest) -> None:
        """Adds a request."""
        self._waiting.append(request)

    @property
    def first(self) -> StepRequest | None:
        """The first request; None without one."""
        return self._waiting[0] if self._waiting else None

    def count(self, request: StepRequest, steps: int) -> bool:
        """Counts `steps` of a request as run; returns False if the request has ended."""
        if request not in self._waiting or steps <= 0:
            return False
        request.made += min(steps, request.left)
        if request.over:
            self._waiting.remove(request)
        return True

    def drop(self, reason: str, only: StepRequest | None = None) -> list[StepRequest]:
        """Ends all requests, or `only` one, early; returns those whose callbacks are due."""
        dropped = [request for request in self._waiting if only is None or request is only]
        self._waiting = [request for request in self._waiting if request not in dropped]
        for request in dropped:
            request.reason = reason
        return dropped
