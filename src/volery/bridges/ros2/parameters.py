"""Parameters of nodes for ROS 2: six services for each node, and their events.

The owner of the parameters determines how a value is set: see `SetValue`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from volery.bridges.ros2.middleware import Handle, Participant, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.profiles import profile_of
from volery.bridges.ros2.services import answerer
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type, time_from_ns
from volery.graph.parameter_values import NOT_SET, plain_of, type_of, value_message
from volery.graph.parameters import Parameters
from volery.graph.service_reply import ServiceReply

_SIM_TIME = "use_sim_time"
"""Parameter of every ROS 2 node; here it is true and read-only."""
_ALWAYS_SIM_TIME = f"parameter '{_SIM_TIME}' is read-only: nodes here follow /clock"
_EVENTS = "/parameter_events"
_EVENT_TYPE = "rcl_interfaces/msg/ParameterEvent"
_SERVICES = (
    "DescribeParameters",
    "GetParameterTypes",
    "GetParameters",
    "ListParameters",
    "SetParameters",
    "SetParametersAtomically",
)


SetValue = Callable[[str, str, Any, Callable[[str], None]], None]
"""(node, parameter, value, done): sets a value; calls `done` later, with a reason on failure."""


class ParameterServices:
    """The parameters of all nodes of a graph; `survey` updates the nodes.

    owner: the node of the whole process, which may have no parameters. now_ns: stamps of the
    events.
    """

    def __init__(
        self,
        participant: Participant,
        parameters: Parameters,
        set_value: SetValue,
        owner: NodeName,
        worker: Ros2WriterThread,
        now_ns: Callable[[], int],
    ) -> None:
        self._participant = participant
        self._declared = parameters
        self._set_value = set_value
        self._owner = owner
        self._worker = worker
        self._now_ns = now_ns
        self._nodes: dict[NodeName, list[Handle]] = {}
        self._warnings = WarningFilter()
        spec = TopicSpec(owner, _EVENTS, _EVENT_TYPE, profile_of(_EVENTS, "", latched=False))
        self._events = participant.writer(spec)

    def survey(self) -> None:
        """Adds new nodes with parameters, and removes nodes that have ended."""
        wanted = {self._owner, *map(NodeName.of, self._declared.nodes())}
        for node in [node for node in self._nodes if node not in wanted]:
            self._leave(node)
        for node in wanted - self._nodes.keys():
            self._warnings.tried(node.full, lambda n=node: self._enter(n))  # type: ignore[misc]

    def _enter(self, node: NodeName) -> None:
        check_name(node.full)
        self._participant.add_node(node)
        self._nodes[node] = [self._serve(node, base) for base in _SERVICES]

    def close(self) -> None:
        """Removes all nodes."""
        for node in tuple(self._nodes):
            self._leave(node)
        self._events.close()

    def _leave(self, node: NodeName) -> None:
        for handle in self._nodes.pop(node):
            handle.close()
        self._participant.remove_node(node)

    def _serve(self, node: NodeName, base: str) -> Handle:
        srvtype = f"rcl_interfaces/srv/{base}"
        word = "".join(f"_{c.lower()}" if c.isupper() else c for c in base).strip("_")
        answers: dict[str, Callable[[NodeName, Any, ServiceReply], None]] = {
            "DescribeParameters": self._describe,
            "GetParameterTypes": self._types,
            "GetParameters": self._get,
            "ListParameters": self._list,
            "SetParameters": self._set,
            "SetParametersAtomically": self._set_all,
        }
        take = answerer(
            self._worker,
            srvtype,
            lambda request, reply: answers[base](node, request, reply),
            self._warnings,
        )
        return self._participant.server(ServiceSpec(node, f"{node.full}/{word}", srvtype), take)

    # ------------------------------------------------------------------------------------ reading

    def _names(self, node: NodeName) -> list[str]:
        return sorted(
            {_SIM_TIME, *(name for at, name in self._declared.names() if at == node.full)}
        )

    def _value(self, node: NodeName, name: str) -> Any:
        """Returns the value of a parameter; None if there is no such parameter."""
        try:
            return self._declared.get(node.full, name).value
        except GraphError:
            return True if name == _SIM_TIME else None

    def _is_read_only(self, node: NodeName, name: str) -> bool:
        try:
            return self._declared.get(node.full, name).read_only
        except GraphError:
            return True

    def _list(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        names = [n for n in self._names(node) if _is_below(n, request.prefixes, request.depth)]
        prefixes = sorted({name.rpartition(".")[0] for name in names} - {""})
        response = zero_message("rcl_interfaces/srv/ListParameters_Response")
        response.result.names, response.result.prefixes = names, prefixes
        reply.answer(response)

    def _get(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        values = [value_message(self._value(node, name)) for name in request.names]
        reply.answer(message_type("rcl_interfaces/srv/GetParameters_Response")(values))

    def _types(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        found = [type_of(self._value(node, name)) for name in request.names]
        response = message_type("rcl_interfaces/srv/GetParameterTypes_Response")
        reply.answer(response(np.array(found, np.uint8)))

    def _describe(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        descriptors = []
        for name in request.names:
            descriptor = zero_message("rcl_interfaces/msg/ParameterDescriptor")
            descriptor.name, descriptor.type = name, type_of(self._value(node, name))
            descriptor.read_only = self._is_read_only(node, name)
            descriptors.append(descriptor)
        reply.answer(message_type("rcl_interfaces/srv/DescribeParameters_Response")(descriptors))

    # ----------------------------------------------------------------------------------- setting

    def _set(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        response = message_type("rcl_interfaces/srv/SetParameters_Response")
        self._set_each(node, request.parameters, lambda found: reply.answer(response(found)))

    def _set_all(self, node: NodeName, request: Any, reply: ServiceReply) -> None:
        """Sets all parameters or none: refused if one is read-only or unknown."""
        response = message_type("rcl_interfaces/srv/SetParametersAtomically_Response")
        bad = [p.name for p in request.parameters if self._refuses(node, p)]
        if bad:
            text = f"read-only or not declared: {', '.join(bad)}"
            reply.answer(response(_result(text)))
            return

        def done(found: list[Any]) -> None:
            wrong = [one for one in found if not one.successful]
            reply.answer(response(wrong[0] if wrong else _result("")))

        self._set_each(node, request.parameters, done)

    def _refuses(self, node: NodeName, parameter: Any) -> bool:
        if self._is_clock(node, parameter.name):
            return plain_of(parameter.value) is not True
        return self._is_read_only(node, parameter.name)

    def _set_each(
        self, node: NodeName, wanted: list[Any], done: Callable[[list[Any]], None]
    ) -> None:
        """Sets parameters one after the other; `done` receives the results."""
        results: list[Any] = []

        def go_on() -> None:
            if len(results) == len(wanted):
                done(results)
                return
            parameter = wanted[len(results)]
            if parameter.value.type == NOT_SET:
                finish(f"parameter '{parameter.name}' cannot be deleted")
            elif self._is_clock(node, parameter.name):
                finish("" if plain_of(parameter.value) is True else _ALWAYS_SIM_TIME)
            else:
                self._set_value(node.full, parameter.name, plain_of(parameter.value), finish)

        def finish(reason: str) -> None:
            if not reason and not self._is_clock(node, wanted[len(results)].name):
                self._publish_event(node, wanted[len(results)])
            results.append(_result(reason))
            go_on()

        go_on()

    def _is_clock(self, node: NodeName, name: str) -> bool:
        """Returns whether it is the parameter that every node has without declaring it."""
        return name == _SIM_TIME and (node.full, name) not in self._declared.names()

    def _publish_event(self, node: NodeName, parameter: Any) -> None:
        event = zero_message(_EVENT_TYPE)
        event.stamp = time_from_ns(self._now_ns())
        event.node, event.changed_parameters = node.full, [parameter]
        self._worker.post(lambda: self._events.write(encode_cdr(event, _EVENT_TYPE)))


def _result(reason: str) -> Any:
    return message_type("rcl_interfaces/msg/SetParametersResult")(not reason, reason)


def _is_below(name: str, prefixes: list[str], depth: int) -> bool:
    """Returns whether a name is below one of the prefixes, at most `depth` dots deep.

    0: any depth.
    """
    for prefix in prefixes or [""]:
        start = f"{prefix}." if prefix else ""
        rest = name[len(start) :]
        if name == prefix or (name.startswith(start) and (not depth or rest.count(".") < depth)):
            return True
    return False
