"""Access policies of the page's rosbridge clients."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from volery.bridges.rosbridge.fields import absolute
from volery.bridges.rosbridge.wire import Operation
from volery.core.data_tables import read_table
from volery.core.errors import BridgeError, CommandError
from volery.runtime.services.control_authority import HAND_OVER, RELEASE, TAKE
from volery.runtime.vehicles.control_authority import (
    MAX_CHARACTERS,
    ControlAuthority,
    operator_name,
    same_operator,
)
from volery.runtime.vehicles.control_targets import names_in, parts_of
from volery.server.operator_names import OperatorNames

READ_ONLY_SERVICES = frozenset(read_table(__file__, "read_only_services.toml")["services"])
"""Services that change nothing: viewers may call them, and they command no UAV."""


_LOOKING = {"subscribe", "unsubscribe", "set_level", "status", "auth"}
"""Operations without effect on other clients."""
_NAMED_BY = {
    "publish": "topic",
    "advertise": "topic",
    "advertise_service": "service",
    "advertise_action": "action",
}
"""The field that names what each of these operations acts on; others do not count."""
_WARN_AGAIN_S = 1.0
"""Min period of refusals for a stream of commands."""
_MAX_WARNED = 1000


class ViewerPolicy:
    """Allows a client to watch only."""

    def check(self, operation: Operation) -> bool:
        """Raises BridgeError for an operation that changes something."""
        op = operation["op"]
        if op in _LOOKING or (op == "call_service" and service_of(operation) in READ_ONLY_SERVICES):
            return True
        what = operation.get("service", operation.get("topic", operation.get("action", "")))
        doing = f"{op.replace('_', ' ')} {what}".strip()
        raise BridgeError(f"a viewer may not {doing[:120]}; connect with the operators' token")


class OperatorPolicy:
    """Allows a client to command the UAVs that no other operator controls.

    `name` is the operator's name, one of the `operator_names` of this server. Requests to the
    control services are signed with the operator's own name.
    """

    def __init__(
        self,
        name: str,
        operator_names: OperatorNames,
        operators: ControlAuthority,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self._operator_names = operator_names
        self._operators = operators
        self._now_s = now_s
        self._warned_s: dict[str, float] = {}

    def check(self, operation: Operation) -> bool:
        """Raises BridgeError for a command to a UAV that another operator controls."""
        op = operation["op"]
        if op == "call_service":
            service = service_of(operation)
            if service in (TAKE, RELEASE, HAND_OVER):
                self._sign(service, operation)
            elif service not in READ_ONLY_SERVICES:
                self._check_free(service, operation)
        elif op == "send_action_goal":
            self._check_free(_absolute(operation.get("action")), operation)
        elif op in _NAMED_BY:
            return self._may_publish(_absolute(operation.get(_NAMED_BY[op])))
        return True

    def _may_publish(self, topic: str) -> bool:
        """Returns whether a publication passes; refusals of a stream are reported periodically."""
        try:
            self._check_free(topic, {})
        except BridgeError:
            now_s = self._now_s()
            if now_s - self._warned_s.get(topic, -_WARN_AGAIN_S) < _WARN_AGAIN_S:
                return False
            if len(self._warned_s) >= _MAX_WARNED:
                self._warned_s.clear()
            self._warned_s[topic] = now_s
            raise
        return True

    def _check_free(self, name: str, operation: Operation) -> None:
        """Raises BridgeError for a name below, about or moving a UAV of another operator."""
        try:
            moved = self._operators.moved_by(name)
            about = {*parts_of(name), *moved, *names_in(operation.get("args"))}
        except CommandError as error:
            raise BridgeError(str(error)) from None
        for uav in sorted(about):
            holder = self._operators.operator_of(uav)
            if holder and not same_operator(holder, self.name):
                raise BridgeError(f"{uav} is held by {holder}, who can hand it over")

    def _sign(self, service: str, operation: Operation) -> None:
        """Sets the operator's own name in a request to the control services.

        Raises BridgeError if the request is made in another operator's name.
        """
        args = operation.get("args")
        if not isinstance(args, dict):
            raise BridgeError(f"{service}: args must be an object with uav")
        called = args.get("operator")
        if isinstance(called, str) and called.strip() and not same_operator(called, self.name):
            called = operator_name(called)
            if not 0 < len(called) <= MAX_CHARACTERS:
                raise BridgeError(f"an operator's name has 1 to {MAX_CHARACTERS} characters")
            if service != TAKE or self._operators.held_by(self.name):
                raise BridgeError(f"you are {self.name}, not {called[:MAX_CHARACTERS]}")
            self._operator_names.rename(self.name, called)
            self.name = called
        to = args.get("to")
        if service == HAND_OVER and to not in self._operator_names:
            raise BridgeError(f"no operator is called {str(to)[:MAX_CHARACTERS]!r} here")
        operation["args"] = {**args, "operator": self.name}


def service_of(operation: Operation) -> str:
    """Returns the graph name of a called service: `/add`, or in old clients `/add#3`."""
    return _absolute(str(operation.get("service", "")).partition("#")[0])


def _absolute(name: Any) -> str:
    return absolute(str(name or ""))
