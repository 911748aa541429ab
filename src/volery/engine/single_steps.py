"""Single steps that somebody asked a paused run for, and how far they have come."""

from __future__ import annotations

from collections.abc import Callable

OnSteps = Callable[["StepRequest"], None]
"""Called after each piece of a request and at its end, in the thread that made or ended it."""


class StepRequest:
    """`steps` physics steps to be made while paused; read it, but leave the changing to `Pacer`."""

    def __init__(self, steps: int, on_steps: OnSteps | None = None) -> None:
        self.steps = steps
        self.made = 0
        """Steps that have been made."""
        self.reason = ""
        """Why no more will be made although some are left; empty where nothing is wrong."""
        self._on_steps = on_steps

    @property
    def left(self) -> int:
        """Steps that are still to be made, or were when the request ended early."""
        return self.steps - self.made

    @property
    def over(self) -> bool:
        """Whether nothing more will happen to it."""
        return self.left == 0 or bool(self.reason)

    def tell(self) -> None:
        """Tell whoever asked; called without locks held."""
        if self._on_steps is not None:
            self._on_steps(self)


class StepQueue:
    """Requests in the order of arrival. Not locked: its owner does that."""

    def __init__(self) -> None:
        self._waiting: list[StepRequest] = []

    def __bool__(self) -> bool:
        """Whether steps are to be made."""
        return bool(self._waiting)

    def add(self, request: StepRequest) -> None:
        """Let a request wait for its turn."""
        self._waiting.append(request)

    @property
    def first(self) -> StepRequest | None:
        """The request whose turn it is."""
        return self._waiting[0] if self._waiting else None

    def count(self, request: StepRequest, steps: int) -> bool:
        """Note that `steps` were made for a request; false where it has ended meanwhile."""
        if request not in self._waiting or steps <= 0:
            return False
        request.made += min(steps, request.left)
        if request.over:
            self._waiting.remove(request)
        return True

    def drop(self, reason: str, only: StepRequest | None = None) -> list[StepRequest]:
        """End all requests, or `only` that one, early; returns those that must be told."""
        dropped = [request for request in self._waiting if only is None or request is only]
        self._waiting = [request for request in self._waiting if request not in dropped]
        for request in dropped:
            request.reason = reason
        return dropped
