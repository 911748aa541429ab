"""Provides actions: long-running goals with feedback, which clients may cancel.

Bridges that support actions send goals for their clients:

    kind = "simulation_interfaces/action/SimulateSteps"
    actions.create_server("/simulate_steps", kind, start_goal)
    ...
    goal = actions.send_goal("/simulate_steps", request, on_feedback, on_result)
    goal.cancel()

Everything happens in the simulation's thread; a bridge gets there through `Gateway.post` and calls
`cancel` there too. Feedback and results may come from any thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from volery.core.errors import GraphError
from volery.graph.messages import message_type


class GoalStatus(IntEnum):
    """Status of a goal, numbered as in `action_msgs/msg/GoalStatus`."""

    ACCEPTED = 1
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


OnFeedback = Callable[[Any], None]
OnResult = Callable[[GoalStatus, Any], None]


class Goal:
    """One active goal; ends once, with a result."""

    def __init__(self, request: Any, on_feedback: OnFeedback, on_result: OnResult) -> None:
        self.request = request
        """The `_Goal` message."""
        self.status = GoalStatus.ACCEPTED
        self._on_feedback = on_feedback
        self._on_result = on_result
        self._on_cancel: Callable[[], None] | None = None
        self._lock = threading.Lock()

    # ------------------------------------------------------------------------ action server

    def feedback(self, message: Any) -> None:
        """Sends a `_Feedback` message; has no effect after the goal's end."""
        if self.status is GoalStatus.ACCEPTED:
            self._on_feedback(message)

    def succeed(self, result: Any) -> None:
        """Ends the goal as succeeded, with a `_Result` message."""
        self._end(GoalStatus.SUCCEEDED, result)

    def abort(self, result: Any) -> None:
        """Ends the goal as aborted, with a `_Result` message."""
        self._end(GoalStatus.ABORTED, result)

    def canceled(self, result: Any) -> None:
        """Ends the goal as cancelled by its client, with a `_Result` message."""
        self._end(GoalStatus.CANCELED, result)

    def when_cancelled(self, callback: Callable[[], None]) -> None:
        """Sets the callback for a request to cancel the goal."""
        self._on_cancel = callback

    # -------------------------------------------------------------------------- action client

    def cancel(self) -> bool:
        """Requests cancellation; returns whether that is possible. The result comes later."""
        if self.status is not GoalStatus.ACCEPTED or self._on_cancel is None:
            return False
        self._on_cancel()
        return True

    def _end(self, status: GoalStatus, result: Any) -> None:
        with self._lock:
            if self.status is not GoalStatus.ACCEPTED:
                return
            self.status = status
        self._on_result(status, result)


@dataclass(frozen=True)
class ActionServer:
    """An action server: `start(goal)` starts a goal, and ends it at once or later."""

    name: str
    action_type: str
    """Name of the type, such as `simulation_interfaces/action/SimulateSteps`."""
    start: Callable[[Goal], None]


class Actions:
    """Holds all actions of one graph."""

    def __init__(self) -> None:
        self._servers: dict[str, ActionServer] = {}
        self._lock = threading.Lock()

    def create_server(
        self, name: str, action_type: str, start: Callable[[Goal], None]
    ) -> ActionServer:
        """Creates an action server. Raises `GraphError` for an unknown type or a name in use."""
        try:
            message_type(f"{action_type}_Goal")
        except KeyError:
            raise GraphError(f"action '{name}': unknown type '{action_type}'") from None
        server = ActionServer(name, action_type, start)
        with self._lock:
            if name in self._servers:
                raise GraphError(f"action '{name}' already has a server")
            self._servers[name] = server
        return server

    def destroy_server(self, name: str) -> None:
        """Removes an action server; active goals continue."""
        with self._lock:
            self._servers.pop(name, None)

    def types(self) -> dict[str, str]:
        """Returns the names of all actions and their types."""
        with self._lock:
            return {name: server.action_type for name, server in sorted(self._servers.items())}

    def send_goal(
        self, name: str, request: Any, on_feedback: OnFeedback, on_result: OnResult
    ) -> Goal:
        """Sends a goal, a `_Goal` message.

        on_feedback: receives `_Feedback` messages. on_result: receives the status and a `_Result`
        message. Raises `GraphError` if the action has no server or the message another type.
        """
        with self._lock:
            server = self._servers.get(name)
        if server is None:
            raise GraphError(f"action '{name}' has no server")
        goal_type = f"{server.action_type}_Goal"
        if getattr(request, "__msgtype__", None) != goal_type:
            raise GraphError(f"action '{name}' requires a message of type {goal_type}")
        goal = Goal(request, on_feedback, on_result)
        server.start(goal)
        return goal
