"""What a submission may read and command over its connection."""

from __future__ import annotations

from collections.abc import Callable

from volery.bridges.rosbridge.fields import absolute
from volery.bridges.rosbridge.wire import Operation
from volery.bridges.topic_patterns import topic_filter
from volery.core.errors import BridgeError
from volery.grading.assignment import Assignment
from volery.graph.nodes.presence import PREFIX

_JOIN = "/volery/join_lock_step"
_READS = ("/clock", "/tf", "/tf_static", "/volery/lock_step/*/go")
_WRITES = ("/rosout", f"{PREFIX}/**", "/volery/lock_step/*/done", _JOIN)
_QUESTIONS = (
    "/rosapi/topics",
    "/rosapi/topic_type",
    "/rosapi/services",
    "/rosapi/service_type",
    "/rosapi/message_details",
    "/rosapi/get_time",
)
_NAMED_BY = {
    "advertise": "topic",
    "unadvertise": "topic",
    "publish": "topic",
    "advertise_service": "service",
    "unadvertise_service": "service",
    "call_service": "service",
    "send_action_goal": "action",
    "cancel_action_goal": "action",
}
_FREE = ("unsubscribe", "set_level", "status", "auth", "service_response")


class SubmissionGate:
    """Lets a node read and command its UAV, and nothing else.

    It reads no true states, and moves its UAV by flying only. The period and timeout of its lock
    step are those of the assignment.
    """

    def __init__(self, assignment: Assignment) -> None:
        terms, uav = assignment.terms, f"/{assignment.terms.uav}"
        self._terms = terms
        self._reads: Callable[[str], bool] = topic_filter(
            (f"{uav}/**", *_READS, *terms.reads), (f"{uav}/ground_truth/**",)
        )
        self._writes: Callable[[str], bool] = topic_filter(
            (f"{uav}/**", *_WRITES, *_QUESTIONS, *terms.writes), (f"{uav}/pose_command",)
        )

    def check(self, operation: Operation) -> bool:
        """Raises `BridgeError` for an operation that is not allowed."""
        op = operation["op"]
        if op in _FREE:
            return True
        if op == "subscribe":
            topic = absolute(str(operation.get("topic", "")))
            if not self._reads(topic):
                raise BridgeError(f"a submission may not read {topic[:120]}")
            return True
        name = absolute(str(operation.get(_NAMED_BY.get(op, ""), "")))
        if op not in _NAMED_BY or not self._writes(name):
            raise BridgeError(f"a submission may not {op.replace('_', ' ')} {name[:120]}")
        if name == _JOIN and op == "call_service":
            args = operation.get("args")
            given = args if isinstance(args, dict) else {}
            operation["args"] = {
                **given,
                "period_s": self._terms.period_s,
                "timeout_s": self._terms.timeout_s,
                "stop_on_timeout": False,
                "supports_reset": False,
                "meets_at_start": True,
            }
        return True
