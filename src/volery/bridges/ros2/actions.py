"""Action servers for ROS 2 clients: three services and two topics each, as in rcl_action.

https://design.ros2.org/articles/actions.html
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from volery.bridges.ros2.middleware import Handle, Participant, Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.services import answerer
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.core.errors import GraphError
from volery.graph.actions import Goal, GoalStatus
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type, time_from_ns
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Session

MAX_GOALS = 1000
"""Stored goals of an action, with their results; beyond, the oldest finished one is removed."""

_CANCELING = 3
"""Values of action_msgs/msg/GoalStatus, as in `GoalStatus`."""
_UNKNOWN = 0
_REJECTED, _UNKNOWN_GOAL, _TERMINATED = 1, 2, 3
"""Return codes of action_msgs/srv/CancelGoal."""
_LATCHED = Profile(latched=True, depth=1)  # rcl_action_qos_profile_status_default

_log = logging.getLogger(__name__)


class _Asked:
    """A goal that a client has sent."""

    def __init__(self, goal_id: bytes, accepted_ns: int) -> None:
        self.goal_id = goal_id
        self.accepted_ns = accepted_ns
        self.goal: Goal | None = None
        self.status = int(GoalStatus.ACCEPTED)
        self.result: Any = None
        self.waiting: list[ServiceReply] = []

    @property
    def ended(self) -> bool:
        """Whether its result is available."""
        return self.result is not None


class ActionServer:
    """One action. All methods run in the simulation's thread."""

    def __init__(
        self,
        participant: Participant,
        session: Session,
        worker: Ros2WriterThread,
        node: NodeName,
        action: tuple[str, str],
    ) -> None:
        self._session = session
        self._graph = session.graph
        self._worker = worker
        self._name, self._type = action
        self._asked: OrderedDict[bytes, _Asked] = OrderedDict()
        self._warnings = WarningFilter()
        self._feedback_type = f"{self._type}_FeedbackMessage"
        prefix = f"{self._name}/_action"
        feedback = TopicSpec(node, f"{prefix}/feedback", self._feedback_type)
        status = TopicSpec(node, f"{prefix}/status", "action_msgs/msg/GoalStatusArray", _LATCHED)
        self._feedback = participant.writer(feedback)
        self._status = participant.writer(status)
        self._handles: list[Handle] = [self._feedback, self._status]
        for word, srvtype, take in (
            ("send_goal", f"{self._type}_SendGoal", self._on_goal),
            ("cancel_goal", "action_msgs/srv/CancelGoal", self._on_cancel),
            ("get_result", f"{self._type}_GetResult", self._on_result),
        ):
            spec = ServiceSpec(node, f"{prefix}/{word}", srvtype)
            serve = answerer(worker, srvtype, self._in_simulation(take), self._warnings)
            self._handles.append(participant.server(spec, serve))

    def close(self) -> None:
        """Destroys the action server; open goals are cancelled."""
        for asked in tuple(self._asked.values()):
            if asked.goal is not None and not asked.ended:
                self._graph.post(asked.goal.cancel)
        for handle in self._handles:
            handle.close()

    def _in_simulation(
        self, take: Callable[[Any, ServiceReply], None]
    ) -> Callable[[Any, ServiceReply], None]:
        def ask(request: Any, reply: ServiceReply) -> None:
            self._graph.post(lambda: take(request, reply))

        return ask

    # ------------------------------------------------------------------------------------- goals

    def _on_goal(self, request: Any, reply: ServiceReply) -> None:
        now_ns = self._graph.now_ns()
        goal_id = request.goal_id.uuid.tobytes()
        asked = _Asked(goal_id, now_ns)
        accepted = goal_id not in self._asked and self._make_room()
        if accepted:
            self._asked[goal_id] = asked
            accepted = self._begin(asked, request.goal)
        response = message_type(f"{self._type}_SendGoal_Response")
        reply.answer(response(accepted, time_from_ns(now_ns)))
        self._publish_status()

    def _make_room(self) -> bool:
        if len(self._asked) >= MAX_GOALS:
            old = next((key for key, asked in self._asked.items() if asked.ended), None)
            if old is None:
                return False
            del self._asked[old]
        return True

    def _begin(self, asked: _Asked, request: Any) -> bool:
        self._session.record_command("goal", self._name, self._type, request)
        try:
            asked.goal = self._graph.actions.send_goal(
                self._name,
                request,
                lambda message: self._publish_feedback(asked, message),
                lambda status, result: self._end(asked, status, result),
            )
        except GraphError as error:
            _log.warning("ROS 2 action %s: %s", self._name, error)
            self._asked.pop(asked.goal_id, None)
            return False
        return True

    def _publish_feedback(self, asked: _Asked, message: Any) -> None:
        feedback = message_type(self._feedback_type)(_uuid(asked.goal_id), message)
        self._worker.post(lambda: self._feedback.write(encode_cdr(feedback, self._feedback_type)))

    def _end(self, asked: _Asked, status: GoalStatus, result: Any) -> None:
        asked.status = int(status)
        asked.result = zero_message(f"{self._type}_Result") if result is None else result
        waiting, asked.waiting = asked.waiting, []
        for reply in waiting:
            reply.answer(self._response(asked))
        self._publish_status()

    def _response(self, asked: _Asked) -> Any:
        return message_type(f"{self._type}_GetResult_Response")(asked.status, asked.result)

    def _on_result(self, request: Any, reply: ServiceReply) -> None:
        asked = self._asked.get(request.goal_id.uuid.tobytes())
        if asked is None:
            response = zero_message(f"{self._type}_GetResult_Response")
            response.status = _UNKNOWN
            reply.answer(response)
        elif asked.ended:
            reply.answer(self._response(asked))
        else:
            asked.waiting.append(reply)

    # ---------------------------------------------------------------------------------- ending

    def _on_cancel(self, request: Any, reply: ServiceReply) -> None:
        response = zero_message("action_msgs/srv/CancelGoal_Response")
        goal_id = request.goal_info.goal_id.uuid.tobytes()
        stamp = request.goal_info.stamp
        before_ns = stamp.sec * 10**9 + stamp.nanosec
        if goal_id.strip(b"\0") and not before_ns:
            chosen = [a for a in (self._asked.get(goal_id),) if a is not None]
        else:  # all, all until a time, or those and the named one
            chosen = [
                a
                for a in self._asked.values()
                if a.goal_id == goal_id or not before_ns or a.accepted_ns <= before_ns
            ]
        ending = [a for a in chosen if self._cancel(a)]
        response.goals_canceling = [_info(asked) for asked in ending]
        if goal_id.strip(b"\0") and not ending:
            known = self._asked.get(goal_id)
            ended = known is not None and known.ended
            response.return_code = (
                _UNKNOWN_GOAL if known is None else _TERMINATED if ended else _REJECTED
            )
        reply.answer(response)
        self._publish_status()

    def _cancel(self, asked: _Asked) -> bool:
        if asked.ended or asked.goal is None:
            return False
        self._session.record_command("cancel", self._name, self._type)
        if not asked.goal.cancel():
            return False
        if not asked.ended:
            asked.status = _CANCELING
        return True

    def _publish_status(self) -> None:
        entry = message_type("action_msgs/msg/GoalStatus")
        found = [entry(_info(asked), asked.status) for asked in self._asked.values()]
        status = message_type("action_msgs/msg/GoalStatusArray")(found)
        self._worker.post(lambda: self._status.write(encode_cdr(status, status.__msgtype__)))


class ActionServers:
    """All actions of a graph; `survey` updates them."""

    def __init__(
        self, participant: Participant, session: Session, node: NodeName, worker: Ros2WriterThread
    ) -> None:
        self._parts = participant, session, worker, node
        self._session = session
        self._servers: dict[str, ActionServer] = {}
        self._warnings = WarningFilter()

    def survey(self) -> None:
        """Creates servers of new actions and destroys those of removed ones."""
        types = self._session.graph.actions.types()
        for name in [name for name in self._servers if name not in types]:
            self._servers.pop(name).close()
        for name, action_type in types.items():
            if name not in self._servers:
                self._warnings.tried(name, lambda n=name, t=action_type: self._offer(n, t))  # type: ignore[misc]

    def _offer(self, name: str, action_type: str) -> None:
        check_name(name)
        self._servers[name] = ActionServer(*self._parts, (name, action_type))

    def close(self) -> None:
        """Destroys all action servers."""
        for server in self._servers.values():
            server.close()


def _uuid(goal_id: bytes) -> Any:
    import numpy as np

    return message_type("unique_identifier_msgs/msg/UUID")(np.frombuffer(goal_id, np.uint8))


def _info(asked: _Asked) -> Any:
    stamp = time_from_ns(asked.accepted_ns)
    return message_type("action_msgs/msg/GoalInfo")(_uuid(asked.goal_id), stamp)
