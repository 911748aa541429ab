"""The bridge to native ROS 2: the simulation and its nodes are ordinary nodes of a ROS 2 graph.

    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(Ros2Bridge())
        simulation.run(speed=1.0)

Topics that the graph publishes appear in ROS 2 under the same names; topics that it subscribes to
are received from ROS 2. ROS 2 nodes can use its services, actions and parameters, and the graph can
call ROS 2 services that are named to the bridge. ROS 2 need not be installed.
"""

from __future__ import annotations

import asyncio
import json
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from volery.bridges.ros2.actions import ActionServers
from volery.bridges.ros2.environment import Ros2Environment, domain_of, join_ros2
from volery.bridges.ros2.middleware import Participant
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.parameters import ParameterServices
from volery.bridges.ros2.services import Ros2Services
from volery.bridges.ros2.topics import Ros2Topics
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.bridges.shared_names import COMMANDS, SharedNames
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway, Session

_SURVEY_S = 0.25
_BREATH_S = 0.02
"""Shortest time between two surveys, however often others appear and leave."""
NODE = "/volery"
_SET = "rosapi_msgs/srv/SetParam"

_joined: set[tuple[str, int, str]] = set()
"""Middlewares, domains and node names of the open bridges of this process: two of one would receive
every command twice."""
_joined_lock = threading.Lock()

_log = logging.getLogger(__name__)


class Ros2Bridge:
    """Connects the whole simulation to a ROS 2 graph; a `graph.bridge_kind.Bridge`.

    Parameters
    ----------
    terms
        Middleware, domain and interfaces.
    node_name
        Full name of the node of the simulation.
    topics
        Patterns of the names of shared topics and services, as in `fnmatch`.
    commands
        Patterns of topics that ROS 2 may publish besides publishers of the graph.
    reliable
        Patterns of sensor topics that are published reliably.
    remote_services
        ROS 2 services that the graph can call, and their types (`std_srvs/srv/Trigger`).

    """

    def __init__(
        self,
        terms: Ros2Environment | None = None,
        node_name: str = NODE,
        *,
        topics: Sequence[str] = ("*",),
        commands: Sequence[str] = COMMANDS,
        reliable: Sequence[str] = (),
        remote_services: Mapping[str, str] | None = None,
    ) -> None:
        self.name = f"ROS 2 node {node_name}"
        self._node_name = node_name
        self._terms = terms or Ros2Environment()
        self._sharing = SharedNames(tuple(topics), tuple(commands))
        self._reliable = tuple(reliable)
        self._remote = dict(remote_services or {})
        self._shared: _Shared | None = None
        self._steward: threading.Thread | None = None
        self._joined_as: tuple[str, int, str] | None = None
        self._stopping = False
        self._news = threading.Event()

    @property
    def dropped(self) -> dict[str, int]:
        """Number of messages that were not sent in time, by topic, without zeros."""
        return {} if self._shared is None else self._shared.topics.dropped

    async def start(self, gateway: Gateway) -> None:
        """Joins the ROS 2 graph. Raises `BridgeError` if that fails."""
        await asyncio.get_running_loop().run_in_executor(None, self._begin, gateway)

    async def stop(self) -> None:
        """Leaves the ROS 2 graph."""
        await asyncio.get_running_loop().run_in_executor(None, self._end)

    def _begin(self, gateway: Gateway) -> None:
        try:
            check_name(self._node_name)
        except GraphError as error:
            raise BridgeError(str(error)) from None
        joined = (self._terms.middleware, domain_of(self._terms.domain_id), self._node_name)
        with _joined_lock:
            if joined in _joined:
                raise BridgeError(
                    f"ROS 2 domain {joined[1]} is joined already over {joined[0]}, as {joined[2]}"
                )
            participant = join_ros2(self._terms)
            _joined.add(joined)
        self._joined_as = joined
        self.name = f"ROS 2 node {self._node_name}, {participant.where}"
        node = NodeName.of(self._node_name)
        session = gateway.open(self.name)
        shared = _Shared(participant, session, self._sharing, self._reliable, node)
        self._shared = shared
        shared.services.take_remote(self._remote)
        participant.when_changed(self._news.set)
        shared.survey()
        self._steward = threading.Thread(target=self._watch, name="volery-ros2-steward")
        self._steward.daemon = True
        self._steward.start()

    def _end(self) -> None:
        self._stopping = True
        self._news.set()
        if self._steward is not None:
            self._steward.join()
        if self._shared is not None:
            self._shared.close()
            self._shared = None
        if self._joined_as is not None:
            _joined.discard(self._joined_as)
            self._joined_as = None

    def _watch(self) -> None:
        """Updates the shared names in both directions."""
        shared, breath = self._shared, threading.Event()
        while shared is not None and not self._stopping:
            try:
                shared.survey()
            except Exception as error:  # an error of one topic must not end the bridge
                _log.warning("%s: %s: %s", self.name, type(error).__name__, error)
            breath.wait(_BREATH_S)
            self._news.wait(_SURVEY_S)
            self._news.clear()


class _Shared:
    """Everything that the bridge shares."""

    def __init__(
        self,
        participant: Participant,
        session: Session,
        sharing: SharedNames,
        reliable: tuple[str, ...],
        node: NodeName,
    ) -> None:
        self._participant = participant
        self._session = session
        self._worker = Ros2WriterThread()
        self._clerk = Ros2WriterThread(
            "volery-ros2-services"
        )  # answers may wait for the discovery of the caller
        participant.add_node(node)
        self.topics = Ros2Topics(participant, session, sharing, reliable, node, self._worker)
        self.services = Ros2Services(participant, session, sharing, node, self._clerk)
        self._actions = ActionServers(participant, session, node, self._clerk)
        graph = session.graph
        self._parameters = ParameterServices(
            participant, graph.parameters, self._set, node, self._clerk, graph.now_ns
        )

    def survey(self) -> None:
        """Updates all shared names."""
        self.topics.survey()
        self.services.survey()
        self._actions.survey()
        self._parameters.survey()
        self._participant.announce()

    def _set(self, node: str, name: str, value: Any, done: Callable[[str], None]) -> None:
        """Sets a parameter as clients of all bridges do, so that recorded flights repeat it."""
        request = message_type(f"{_SET}_Request")(f"{node}:{name}", json.dumps(value))
        reply = ServiceReply(lambda response: done(response.reason), lambda error: done(str(error)))
        self._session.call("/rosapi/set_param", request, reply)

    def close(self) -> None:
        """Removes all shared names."""
        self._worker.close()
        self._clerk.close()
        self.topics.close()
        self.services.close()
        self._actions.close()
        self._parameters.close()
        self._session.close()
        self._participant.close()
