"""Actions: goals that take their time, tell how far they are, and may be cancelled.

Whoever fulfils goals offers an action; bridges that have actions send goals for their clients:

    actions.offer("/simulate_steps", "simulation_interfaces/action/SimulateSteps", take_goal)
    ...
    goal = actions.send("/simulate_steps", request, on_feedback, on_result)
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
    """How a goal stands, numbered as in `action_msgs/msg/GoalStatus`."""

    ACCEPTED = 1
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


OnFeedback = Callable[[Any], None]
OnResult = Callable[[GoalStatus, Any], None]


class Goal:
    """One goal on its way; ends once, with a result."""

    def __init__(self, request: Any, on_feedback: OnFeedback, on_result: OnResult) -> None:
        self.request = request
        """The `_Goal` message."""
        self.status = GoalStatus.ACCEPTED
        self._on_feedback = on_feedback
        self._on_result = on_result
        self._on_cancel: Callable[[], None] | None = None
        self._lock = threading.Lock()

    # ------------------------------------------------------------------- whoever fulfils it

    def feedback(self, message: Any) -> None:
        """Tell how far it is, with a `_Feedback` message; nothing after its end."""
        if self.status is GoalStatus.ACCEPTED:
            self._on_feedback(message)

    def succeed(self, result: Any) -> None:
        """End it well, with a `_Result` message."""
        self._end(GoalStatus.SUCCEEDED, result)

    def abort(self, result: Any) -> None:
        """End it because it cannot be reached."""
        self._end(GoalStatus.ABORTED, result)

    def canceled(self, result: Any) -> None:
        """End it because that was asked for."""
        self._end(GoalStatus.CANCELED, result)

    def when_cancelled(self, callback: Callable[[], None]) -> None:
        """Have `callback` called when somebody wants it cancelled."""
        self._on_cancel = callback

    # ------------------------------------------------------------------------- whoever sent it

    def cancel(self) -> bool:
        """Ask for its end; whether that is possible at all. The result comes as any other."""
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
class ActionOffer:
    """An action on offer: `take(goal)` begins with a goal and lets it end later."""

    name: str
    action_type: str
    """Such as `simulation_interfaces/action/SimulateSteps`."""
    take: Callable[[Goal], None]


class Actions:
    """All actions of one graph."""

    def __init__(self) -> None:
        self._offers: dict[str, ActionOffer] = {}
        self._lock = threading.Lock()

    def offer(self, name: str, action_type: str, take: Callable[[Goal], None]) -> ActionOffer:
        """Offer an action. `GraphError` for an unknown type or a name that is taken."""
        try:
            message_type(f"{action_type}_Goal")
        except KeyError:
            raise GraphError(f"action '{name}': unknown type '{action_type}'") from None
        offer = ActionOffer(name, action_type, take)
        with self._lock:
            if name in self._offers:
                raise GraphError(f"action '{name}' is offered already")
            self._offers[name] = offer
        return offer

    def withdraw(self, name: str) -> None:
        """Offer an action no more; goals on their way go on."""
        with self._lock:
            self._offers.pop(name, None)

    def types(self) -> dict[str, str]:
        """Names of the actions and their types."""
        with self._lock:
            return {name: offer.action_type for name, offer in sorted(self._offers.items())}

    def send(self, name: str, request: Any, on_feedback: OnFeedback, on_result: OnResult) -> Goal:
        """Send a goal, a `_Goal` message. `GraphError` where nobody offers the action.

        on_feedback: gets `_Feedback` messages. on_result: gets the status and a `_Result` message.
        """
        with self._lock:
            offer = self._offers.get(name)
        if offer is None:
            raise GraphError(f"nobody offers action '{name}'")
        wanted = f"{offer.action_type}_Goal"
        if getattr(request, "__msgtype__", None) != wanted:
            raise GraphError(f"action '{name}' takes {wanted}")
        goal = Goal(request, on_feedback, on_result)
        offer.take(goal)
        return goal
