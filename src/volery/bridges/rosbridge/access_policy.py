"""Restricts what a client may do."""

from __future__ import annotations

from typing import Protocol

from volery.bridges.rosbridge.fields import read_id, with_id
from volery.bridges.rosbridge.wire import Operation


class AccessPolicy(Protocol):
    """Checks the operations of one client, except for those of the connection itself."""

    def check(self, operation: Operation) -> bool:
        """Returns whether the client may execute an operation; raises `BridgeError` with a reason.

        The policy may correct what a client states about itself.
        """


def refusal(operation: Operation, reason: str) -> Operation | None:
    """Returns the response to a refused call or goal; None: a status must report the refusal."""
    if operation["op"] == "call_service":
        answer = {"op": "service_response", "service": operation.get("service")}
    elif operation["op"] == "send_action_goal":
        answer = {"op": "action_result", "action": operation.get("action"), "status": 0}
    else:
        return None
    return with_id(answer | {"values": reason, "result": False}, read_id(operation))
