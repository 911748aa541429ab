"""What a client may do, where not every client may do everything."""

from __future__ import annotations

from typing import Protocol

from volery.bridges.rosbridge.fields import read_id, with_id
from volery.bridges.rosbridge.wire import Operation


class AccessPolicy(Protocol):
    """Stands before the operations of one client, those of the connection itself excepted."""

    def check(self, operation: Operation) -> bool:
        """Whether the client may do that; `BridgeError` with the reason where it shall be told.

        A gate may put right what a client says of itself.
        """


def refusal(operation: Operation, reason: str) -> Operation | None:
    """What a client is answered whose call or goal is refused; None: a status must tell it."""
    if operation["op"] == "call_service":
        answer = {"op": "service_response", "service": operation.get("service")}
    elif operation["op"] == "send_action_goal":
        answer = {"op": "action_result", "action": operation.get("action"), "status": 0}
    else:
        return None
    return with_id(answer | {"values": reason, "result": False}, read_id(operation))
