"""The rosapi services, with which rosbridge clients inspect the graph.

They are ordinary services of the graph below `/rosapi/`, so that clients of every bridge may call
them. Every session is a node there; the simulation itself is the node `/volery`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from volery.bridges.rosbridge.fields import absolute
from volery.bridges.rosbridge.message_encoder import Generation
from volery.bridges.rosbridge.rosapi_parameters import NamedParameters, Parameters
from volery.bridges.rosbridge.rosapi_types import display_name, full_text, type_definitions
from volery.core.clock import stamp_from_ns
from volery.core.errors import GraphError
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway, Session, SessionInfo
from volery.graph.topics import TopicInfo

SIMULATION_NODE = "/volery"
PREFIX = "/rosapi/"

Answer = Callable[[Any], dict[str, Any]]


class RosApi:
    """Offers the services after `start`.

    Parameters
    ----------
    gateway
        Gateway of the graph.
    generation
        Spelling of types in responses.
    now_ns
        Simulated time.
    parameters
        Shared by successive instances.

    """

    def __init__(
        self,
        gateway: Gateway,
        generation: Generation,
        now_ns: Callable[[], int],
        parameters: Parameters | None = None,
    ) -> None:
        self._gateway = gateway
        self._graph = gateway.graph
        self._ros1 = generation == "ros1"
        self._now_ns = now_ns
        self._actions = gateway.graph.actions.types
        self._parameters = NamedParameters(
            parameters or Parameters(), gateway.graph.parameters, ros1=self._ros1
        )
        self._plain = JsonCodec()
        self._session: Session | None = None

    def start(self) -> None:
        """Creates the services, except for those that exist already."""
        table = self._table().items()
        missing = [(k, v) for k, v in table if not self._graph.has_service(PREFIX + k)]
        if not missing:
            return
        session = self._session = self._gateway.open("rosapi", inside=True)
        for name, (base, answer) in missing:
            srvtype = f"rosapi_msgs/srv/{base}"
            session.create_service(PREFIX + name, srvtype, self._handler(srvtype, answer))

    def stop(self) -> None:
        """Destroys the services."""
        if self._session is not None:
            self._session.close()
            self._session = None

    def _handler(self, srvtype: str, answer: Answer) -> Callable[[Any, ServiceReply], None]:
        def handle(request: Any, reply: ServiceReply) -> None:
            try:
                plain = answer(request)
                reply.answer(self._plain.decode(plain, f"{srvtype}_Response"))
            except GraphError as error:
                reply.fail(error)

        return handle

    def _table(self) -> dict[str, tuple[str, Answer]]:
        """Returns the services by name: their types and handlers."""
        return {
            "topics": ("Topics", self._topics),
            "topics_for_type": ("TopicsForType", self._topics_for_type),
            "topic_type": ("TopicType", self._topic_type),
            "topics_and_raw_types": ("TopicsAndRawTypes", self._topics_and_raw_types),
            "services": ("Services", lambda _: {"services": list(self._graph.services())}),
            "services_for_type": ("ServicesForType", self._services_for_type),
            "service_type": ("ServiceType", lambda r: {"type": self._service_type(r.service)}),
            "service_providers": ("ServiceProviders", self._service_providers),
            "service_node": ("ServiceNode", lambda r: {"node": self._service_node(r.service)}),
            "nodes": ("Nodes", lambda _: {"nodes": [SIMULATION_NODE, *self._sessions()]}),
            "node_details": ("NodeDetails", self._node_details),
            "publishers": ("Publishers", self._publishers),
            "subscribers": ("Subscribers", self._subscribers),
            "message_details": ("MessageDetails", lambda r: self._details(r.type, "msg", "")),
            "service_request_details": (
                "ServiceRequestDetails",
                lambda r: self._details(r.type, "srv", "_Request"),
            ),
            "service_response_details": (
                "ServiceResponseDetails",
                lambda r: self._details(r.type, "srv", "_Response"),
            ),
            "get_param": ("GetParam", self._get_param),
            "set_param": ("SetParam", self._set_param),
            "has_param": ("HasParam", self._has_param),
            "delete_param": ("DeleteParam", self._delete_param),
            "get_param_names": ("GetParamNames", lambda _: {"names": self._parameters.names()}),
            "search_param": ("SearchParam", self._search_param),
            "get_time": ("GetTime", self._time),
            "get_ros_version": ("GetROSVersion", self._version),
            "action_servers": ("GetActionServers", self._action_servers),
            "action_type": ("ActionType", lambda r: {"type": self._action_type(r.action)}),
            "interfaces": ("Interfaces", self._interfaces),
        }

    def _name(self, msgtype: str) -> str:
        return display_name(msgtype, ros1=self._ros1)

    # ------------------------------------------------------------------------------------ topics

    def _topics(self, _: Any) -> dict[str, Any]:
        topics = self._graph.topics()
        return {
            "topics": [t.name for t in topics],
            "types": [self._name(t.msgtype) for t in topics],
        }

    def _topics_for_type(self, request: Any) -> dict[str, Any]:
        wanted = ros2_name(request.type)
        return {"topics": [t.name for t in self._graph.topics() if t.msgtype == wanted]}

    def _topic_type(self, request: Any) -> dict[str, Any]:
        msgtype = self._graph.topic_type(absolute(request.topic))
        return {"type": self._name(msgtype) if msgtype else ""}

    def _topics_and_raw_types(self, _: Any) -> dict[str, Any]:
        topics = self._graph.topics()
        texts = {t.msgtype: "" for t in topics}
        for msgtype in texts:
            texts[msgtype] = full_text(msgtype, ros1=self._ros1)
        return self._topics(None) | {"typedefs_full_text": [texts[t.msgtype] for t in topics]}

    def _publishers(self, request: Any) -> dict[str, Any]:
        topic = absolute(request.topic)
        nodes = [node for node, info in self._sessions().items() if topic in info.publishes]
        found = self._topic(topic)
        own = [SIMULATION_NODE] if found and found.publishers > len(nodes) else []
        return {"publishers": own + nodes}

    def _subscribers(self, request: Any) -> dict[str, Any]:
        topic = absolute(request.topic)
        sessions = self._sessions().items()
        nodes = [node for node, info in sessions if topic in _topics_of(info)]
        found = self._topic(topic)
        own = [SIMULATION_NODE] if found and found.subscribers > len(nodes) else []
        return {"subscribers": own + nodes}

    def _topic(self, topic: str) -> TopicInfo | None:
        return next((t for t in self._graph.topics() if t.name == topic), None)

    # ---------------------------------------------------------------------- services and actions

    def _services_for_type(self, request: Any) -> dict[str, Any]:
        wanted = ros2_name(request.type, "srv")
        services = self._graph.services().items()
        return {"services": [name for name, srvtype in services if srvtype == wanted]}

    def _service_type(self, service: str) -> str:
        srvtype = self._graph.services().get(absolute(service))
        return self._name(srvtype) if srvtype else ""

    def _service_node(self, service: str) -> str:
        name = absolute(service)
        if not self._graph.has_service(name):
            return ""
        sessions = self._sessions().items()
        return next((node for node, info in sessions if name in info.offers), SIMULATION_NODE)

    def _service_providers(self, request: Any) -> dict[str, Any]:
        node = self._service_node(request.service)
        return {"providers": [node] if node else []}

    def _action_servers(self, _: Any) -> dict[str, Any]:
        return {"action_servers": list(self._actions())}

    def _action_type(self, action: str) -> str:
        action_type = self._actions().get(absolute(action))
        return self._name(action_type) if action_type else ""

    # ------------------------------------------------------------------------------------- nodes

    def _sessions(self) -> dict[str, SessionInfo]:
        """Returns the sessions by their node names."""
        found: dict[str, SessionInfo] = {}
        for info in self._gateway.sessions():
            base = "/" + re.sub(r"\W+", "_", info.name, flags=re.ASCII).strip("_")
            name, number = base, 2
            while name in found:
                name, number = f"{base}_{number}", number + 1
            found[name] = info
        return found

    def _node_details(self, request: Any) -> dict[str, Any]:
        node = absolute(request.node)
        info = self._sessions().get(node)
        if info is not None:
            return {
                "subscribing": sorted(_topics_of(info)),
                "publishing": list(info.publishes),
                "services": list(info.offers),
            }
        if node != SIMULATION_NODE:
            return {}
        sessions = list(self._sessions().values())
        offered = {name for info in sessions for name in info.offers}
        subscribing, publishing = [], []
        for topic in self._graph.topics():
            if topic.publishers > sum(topic.name in info.publishes for info in sessions):
                publishing.append(topic.name)
            if topic.subscribers > sum(topic.name in _topics_of(info) for info in sessions):
                subscribing.append(topic.name)
        services = [name for name in self._graph.services() if name not in offered]
        return {"subscribing": subscribing, "publishing": publishing, "services": services}

    # --------------------------------------------------------------------------- types, time

    def _details(self, name: str, kind: Any, part: str) -> dict[str, Any]:
        msgtype = ros2_name(name, kind) + part
        typedefs = type_definitions(msgtype, ros1=self._ros1)
        if not part:
            typedefs[0]["type"] = name
        return {"typedefs": typedefs}

    def _interfaces(self, _: Any) -> dict[str, Any]:
        topics = {t.msgtype for t in self._graph.topics()}
        used = topics | set(self._graph.services().values()) | set(self._actions().values())
        return {"interfaces": sorted(self._name(name) for name in used)}

    def _time(self, _: Any) -> dict[str, Any]:
        sec, nanosec = stamp_from_ns(self._now_ns())
        return {"time": {"sec": sec, "nanosec": nanosec}}

    def _version(self, _: Any) -> dict[str, Any]:
        return (
            {"version": 1, "distro": "noetic"}
            if self._ros1
            else {
                "version": 2,
                "distro": "jazzy",
            }
        )

    # -------------------------------------------------------------------------------- parameters

    def _get_param(self, request: Any) -> dict[str, Any]:
        value = self._parameters.get(request.name)
        if value is None and not request.default_value:
            why = f"no parameter '{request.name}'"
            return {"value": "null", "successful": False, "reason": why}
        return {"value": request.default_value if value is None else value, "successful": True}

    def _set_param(self, request: Any) -> dict[str, Any]:
        return self._tried(lambda: self._parameters.set(request.name, request.value))

    def _delete_param(self, request: Any) -> dict[str, Any]:
        return self._tried(lambda: self._parameters.delete(request.name))

    def _tried(self, action: Callable[[], None]) -> dict[str, Any]:
        """Returns the result of an action in rosapi's form.

        Fails the call if there is no such form.
        """
        try:
            action()
        except GraphError as error:
            if self._ros1:
                raise
            return {"successful": False, "reason": str(error)}
        return {"successful": True}

    def _has_param(self, request: Any) -> dict[str, Any]:
        return {"exists": self._parameters.get(request.name) is not None}

    def _search_param(self, request: Any) -> dict[str, Any]:
        found = self._parameters.get(request.name) is not None
        return {"global_name": absolute(request.name) if found else ""}


def _topics_of(info: SessionInfo) -> set[str]:
    return {queue.topic for queue in info.queues}
