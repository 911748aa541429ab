"""Actions of one rosbridge client: goals it sends, and actions it serves.

Goals, feedback and results pass through `graph.actions` as messages of known types, so that clients
and the simulation can send goals to each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from volery.bridges.rosbridge.fields import (
    MAX_FRAGMENT,
    Id,
    absolute,
    read_choice,
    read_id,
    read_limit,
    read_number,
    read_text,
    with_id,
)
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.services import Post, Send, post_nothing, send_nothing
from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError, GraphError
from volery.graph.actions import Goal, GoalStatus
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.codecs.zero import zero_message
from volery.graph.session import Session

MAX_GOALS = 1000
"""Open goals sent by one client, and open goals sent to it."""

_UNKNOWN = 0
"""Value of action_msgs/msg/GoalStatus for a goal that never started."""


@dataclass
class _Asked:
    """A goal that the client has sent."""

    action: str
    """Name used by the client."""
    action_type: str
    reply: Callable[[str, dict[str, Any]], None]
    feedback: bool
    goal: Goal | None = None
    """Known once the simulation's thread has started it."""


@dataclass(frozen=True)
class _Acting:
    """A goal that the client has received."""

    action: str
    action_type: str
    goal: Goal


class RosbridgeActions:
    """The actions of one client. All methods belong to the client's thread."""

    def __init__(self, session: Session, forms: MessageEncoder, send: Send, post: Post) -> None:
        self._session = session
        self._graph = session.graph
        self._forms = forms
        self._send = send
        self._post = post
        self._asked: dict[Id, _Asked] = {}
        self._offers: dict[str, tuple[str, str]] = {}
        self._acting: dict[str, _Acting] = {}
        self._numbers = itertools.count(1)
        self._closed = False

    # ------------------------------------------------------------------------------- sent goals

    def send_goal(self, operation: Operation) -> None:
        """Forwards a goal of the client."""
        action, key = read_text(operation, "action"), read_id(operation)
        size = int(read_limit(operation, "fragment_size", MAX_FRAGMENT)) or None
        compression = read_choice(operation, "compression", ("none", "png", "cbor"))

        def reply(op: str, more: dict[str, Any]) -> None:
            self._send(with_id({"op": op, "action": action, **more}, key), size, compression)

        try:
            action_type = self._check(operation, action, key)
            args = operation.get("args")
            request = decode_plain(args or {}, f"{action_type}_Goal")
        except (GraphError, BridgeError) as error:
            reply("action_result", {"values": str(error), "status": _UNKNOWN, "result": False})
            return
        asked = _Asked(action, action_type, reply, operation.get("feedback") is True)
        self._asked[key] = asked
        self._session.post(lambda: self._begin(key, asked, request))

    def _check(self, operation: Operation, action: str, key: Id) -> str:
        name = absolute(action)
        action_type = self._graph.actions.types().get(name)
        if action_type is None:
            raise BridgeError(f"action '{name}' has no server")
        given = operation.get("action_type")
        if isinstance(given, str) and given and ros2_name(given, "action") != action_type:
            raise BridgeError(f"action '{name}' is a {action_type}, not {given}")
        if key in self._asked:
            raise BridgeError("send_action_goal: a goal with this 'id' is open")
        if len(self._asked) >= MAX_GOALS:
            raise BridgeError(f"send_action_goal: more than {MAX_GOALS} goals are open")
        return action_type

    def _begin(self, key: Id, asked: _Asked, request: Any) -> None:
        """Sends the goal, in the simulation's thread."""

        def on_feedback(message: Any) -> None:
            if asked.feedback:
                self._post(lambda: self._send_feedback(asked, message))

        def on_result(status: GoalStatus, result: Any) -> None:
            self._post(lambda: self._send_result(key, asked, status, result))

        name = absolute(asked.action)
        self._session.record_command("goal", name, asked.action_type, request)
        try:
            asked.goal = self._graph.actions.send_goal(name, request, on_feedback, on_result)
        except Exception as error:  # report any error of the action's server to this client
            text = str(error)
            self._post(lambda: self._send_failure(key, asked, text))

    def _send_feedback(self, asked: _Asked, message: Any) -> None:
        plain = self._forms.plain(message, f"{asked.action_type}_Feedback")
        asked.reply("action_feedback", {"values": plain})

    def _send_result(self, key: Id, asked: _Asked, status: GoalStatus, result: Any) -> None:
        self._asked.pop(key, None)
        plain = {} if result is None else self._forms.plain(result, f"{asked.action_type}_Result")
        # in rosbridge "result" means that there is a result; its outcome is the status
        asked.reply("action_result", {"values": plain, "status": int(status), "result": True})

    def _send_failure(self, key: Id, asked: _Asked, text: str) -> None:
        self._asked.pop(key, None)
        asked.reply("action_result", {"values": text, "status": _UNKNOWN, "result": False})

    def cancel_goal(self, operation: Operation) -> None:
        """Requests the cancellation of a goal."""
        asked = self._asked.get(read_id(operation))
        if asked is None:
            raise BridgeError("cancel_action_goal: no open goal has this 'id'")
        self._session.record_command("cancel", absolute(asked.action), asked.action_type)
        self._session.post(lambda: _cancel(asked))

    # --------------------------------------------------------------------------- received goals

    def advertise(self, operation: Operation) -> None:
        """Creates an action server of the client."""
        action = read_text(operation, "action")
        action_type = ros2_name(read_text(operation, "type"), "action")
        name = absolute(action)

        def take(goal: Goal) -> None:
            self._post(lambda: self._take(action, action_type, goal))

        self._graph.actions.create_server(name, action_type, take)
        self._offers[name] = (action, action_type)

    def unadvertise(self, operation: Operation) -> None:
        """Destroys an action server; its open goals are aborted."""
        name = absolute(read_text(operation, "action"))
        if self._offers.pop(name, None) is None:
            raise BridgeError(f"unadvertise_action: '{name}' is not offered by this client")
        self._graph.actions.destroy_server(name)
        for number in [n for n, a in self._acting.items() if absolute(a.action) == name]:
            _abort(self._acting.pop(number))

    def _take(self, action: str, action_type: str, goal: Goal) -> None:
        """Sends a goal to the client."""
        acting = _Acting(action, action_type, goal)
        if self._closed or len(self._acting) >= MAX_GOALS:
            _abort(acting)
            return
        number = f"goal:{action}:{next(self._numbers)}"
        named = {"id": number, "action": action}

        def on_cancel() -> None:
            cancel = {"op": "cancel_action_goal", **named}
            self._post(lambda: self._send(cancel, None, "none"))

        self._acting[number] = acting
        goal.when_cancelled(on_cancel)
        try:
            args = self._forms.plain(goal.request, f"{action_type}_Goal")
            more = {"action_type": action_type, "args": args, "feedback": True}
            self._send({"op": "send_action_goal", **named, **more}, None, "none")
        except (GraphError, BridgeError):
            _abort(self._acting.pop(number))
            raise

    def take_feedback(self, operation: Operation) -> None:
        """Forwards the client's feedback."""
        acting = self._find(operation)
        values = operation.get("values")
        acting.goal.feedback(decode_plain(values or {}, f"{acting.action_type}_Feedback"))

    def take_result(self, operation: Operation) -> None:
        """Forwards the client's result; a failure without values yields a result of zeros."""
        acting = self._find(operation)
        success = operation.get("result", True) is True
        default = GoalStatus.SUCCEEDED if success else GoalStatus.ABORTED
        status = read_number(operation, "status", default, 0, 6)
        values = operation.get("values")
        plain = values if isinstance(values, dict) or success else {}
        result = decode_plain(plain or {}, f"{acting.action_type}_Result")
        del self._acting[str(read_id(operation))]
        if status == GoalStatus.CANCELED:
            acting.goal.canceled(result)
        elif success and status == GoalStatus.SUCCEEDED:
            acting.goal.succeed(result)
        else:
            acting.goal.abort(result)

    def _find(self, operation: Operation) -> _Acting:
        acting = self._acting.get(str(read_id(operation)))
        if acting is None:
            raise BridgeError(f"{operation['op']}: no open goal has this 'id'")
        return acting

    def close(self) -> None:
        """Cancels the client's goals and aborts the goals that it executes."""
        self._closed = True
        for name in self._offers:
            self._graph.actions.destroy_server(name)
        for acting in tuple(self._acting.values()):
            _abort(acting)
        for asked in tuple(self._asked.values()):
            self._session.post(lambda left=asked: _cancel(left))  # type: ignore[misc]
        self._offers.clear()
        self._acting.clear()
        self._asked.clear()
        self._send, self._post = send_nothing, post_nothing


def _cancel(asked: _Asked) -> None:
    if asked.goal is not None:
        asked.goal.cancel()


def _abort(acting: _Acting) -> None:
    acting.goal.abort(zero_message(f"{acting.action_type}_Result"))
