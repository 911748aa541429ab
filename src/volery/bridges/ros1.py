"""The door to native ROS 1: the simulation joins a real roscore through rospy.

    with Doors(simulation.gateway) as doors:
        doors.open(Ros1Door())
        simulation.run(speed=1.0)

Topics that the graph publishes appear in ROS 1 under the same names; those that it listens to are
taken from ROS 1; its services can be called from there, and ROS 1 services named to the door from
the graph. Without rospy the door does not open and says what to install.
"""

from __future__ import annotations

import asyncio
import fnmatch
import logging
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

from volery.bridges.ros1_node import Ros1Node, join_ros1
from volery.bridges.ros1_outlet import Outlet
from volery.bridges.ros1_pump import Pump
from volery.core.errors import BridgeError, GraphError
from volery.graph.graph import TopicInfo
from volery.graph.reply import Reply
from volery.graph.ros1 import ros1_codec
from volery.graph.session import Gateway, Session

COMMANDS = ("*/cmd_vel", "*/trajectory", "*/goal_pose")
"""Topics taken from ROS 1 also where the graph has publishers of its own."""
_NOT_SHARED = frozenset({"/rosout", "/rosout_agg"})
_SURVEY_S = 0.25
_MASTER_EACH = 4
"""Surveys between two looks at the master."""
_SERVICE_TIMEOUT_S = 30.0
_USE_SIM_TIME = "/use_sim_time"

_log = logging.getLogger(__name__)


class Ros1Door:
    """The whole simulation as one ROS 1 node; a `bridges.doors.Door`.

    Parameters
    ----------
    master_uri, host, anywhere
        See `ros1_node.join_ros1`.
    node_name
        Name of the node.
    topics
        Patterns of the names of topics and services that are shared, as `fnmatch` has them.
    commands
        Patterns of topics that ROS 1 may publish beside publishers of the graph.
    remote_services
        ROS 1 services that the graph can call, and their types (`std_srvs/srv/Trigger`).
    use_sim_time
        Sets that parameter while the door is open, so that nodes that start follow `/clock`.

    """

    def __init__(
        self,
        master_uri: str | None = None,
        node_name: str = "volery",
        *,
        topics: Sequence[str] = ("*",),
        commands: Sequence[str] = COMMANDS,
        remote_services: Mapping[str, str] | None = None,
        use_sim_time: bool = False,
        host: str | None = None,
        anywhere: bool = False,
    ) -> None:
        self.name = f"ROS 1 node /{node_name}"
        self._node_name = node_name
        self._address = {"master_uri": master_uri, "host": host, "anywhere": anywhere}
        self._patterns = tuple(topics)
        self._commands = tuple(commands)
        self._remote = dict(remote_services or {})
        self._use_sim_time = use_sim_time
        self._before: Any = None
        self._bridge: _Bridge | None = None
        self._steward: threading.Thread | None = None
        self._stopping = threading.Event()

    @property
    def dropped(self) -> dict[str, int]:
        """Messages that slow ROS 1 subscribers have missed, by topic, where there are any."""
        return {} if self._bridge is None else self._bridge.dropped

    async def start(self, gateway: Gateway) -> None:
        """Join the ROS 1 graph. `BridgeError` without rospy or a master."""
        await asyncio.get_running_loop().run_in_executor(None, self._begin, gateway)

    async def stop(self) -> None:
        """Take everything back; the node remains, without topics, until the process ends."""
        await asyncio.get_running_loop().run_in_executor(None, self._end)

    def _begin(self, gateway: Gateway) -> None:
        arguments: Any = self._address
        node = join_ros1(self._node_name, **arguments)
        self.name = f"ROS 1 node {node.name} at {node.master.uri}"
        shares = _Sharing(self._patterns, self._commands)
        self._bridge = _Bridge(node, gateway.open(self.name), shares)
        self._keep_sim_time()
        self._bridge.offer_remote(self._remote)
        self._bridge.survey()
        steward = threading.Thread(target=self._watch, name="volery-ros1-steward", daemon=True)
        self._steward = steward
        steward.start()

    def _end(self) -> None:
        self._stopping.set()
        if self._steward is not None:
            self._steward.join()
        if self._bridge is not None:
            self._bridge.close()
            self._restore_sim_time()
            self._bridge = None

    def _watch(self) -> None:
        """Share what appears, take back what goes, register again with a new master."""
        bridge, count, away = self._bridge, 0, False
        while bridge is not None and not self._stopping.wait(_SURVEY_S) and bridge.node.alive:
            count += 1
            if not threading.main_thread().is_alive():
                bridge.close()  # else rospy's threads would keep the process from ending
                return
            try:
                if count % _MASTER_EACH == 0:
                    again = bridge.node.register_again()
                    if again:
                        self._set_sim_time()
                    if again or away:
                        _log.info("ROS master is back at %s", bridge.node.master.uri)
                    away = False
                if not away:
                    bridge.survey()
            except OSError as error:
                if not away:
                    _log.warning("ROS master %s: %s", bridge.node.master.uri, error)
                away = True
            except Exception as error:  # a topic that breaks must not end the door
                _log.warning("%s: %s: %s", self.name, type(error).__name__, error)
        if bridge is not None and not bridge.node.alive:
            _log.error("%s was ended by another node of its name", self.name)

    # ----------------------------------------------------------------------------- use_sim_time

    def _keep_sim_time(self) -> None:
        if self._bridge is not None and self._use_sim_time:
            master = self._bridge.node.master
            if master.ask("hasParam", _USE_SIM_TIME):
                self._before = master.ask("getParam", _USE_SIM_TIME)
            self._set_sim_time()

    def _set_sim_time(self) -> None:
        if self._bridge is not None and self._use_sim_time:
            self._bridge.node.master.ask("setParam", _USE_SIM_TIME, True)

    def _restore_sim_time(self) -> None:
        """Nodes that start later would wait for a clock that is gone."""
        if self._bridge is None or not self._use_sim_time:
            return
        master = self._bridge.node.master
        try:
            if self._before is None:
                master.ask("deleteParam", _USE_SIM_TIME)
            else:
                master.ask("setParam", _USE_SIM_TIME, self._before)
        except (OSError, BridgeError) as error:
            _log.info("%s stays set: %s", _USE_SIM_TIME, error)


class _Sharing:
    """Which names are shared, and in which direction."""

    def __init__(self, patterns: tuple[str, ...], commands: tuple[str, ...]) -> None:
        self._patterns = patterns
        self._commands = commands

    def has(self, name: str) -> bool:
        """Whether a topic or service is shared at all."""
        return name not in _NOT_SHARED and any(fnmatch.fnmatch(name, p) for p in self._patterns)

    def takes(self, topic: str, publishers: int, subscribers: int) -> bool:
        """Whether messages of a topic are taken from ROS 1."""
        if not subscribers:
            return False
        return not publishers or any(fnmatch.fnmatch(topic, p) for p in self._commands)


class _Bridge:
    """What the door shares at present; `survey` brings it up to date, in one thread at a time."""

    def __init__(self, node: Ros1Node, session: Session, sharing: _Sharing) -> None:
        self.node = node
        self._session = session
        self._sharing = sharing
        self._pump = Pump()
        self._outlets: dict[str, Outlet] = {}
        self._inlets: dict[str, Any] = {}
        self._services: dict[str, Any] = {}
        self._remote: set[str] = set()
        self._refused: set[str] = set()

    def survey(self) -> None:
        """Share what has appeared since, take back what has gone."""
        topics = {t.name: t for t in self._session.graph.topics() if self._sharing.has(t.name)}
        wanted = {name: (self._publishers(t), self._subscribers(t)) for name, t in topics.items()}
        for name, (publishers, subscribers) in wanted.items():
            self._update_outlet(topics[name], publishers)
            self._update_inlet(topics[name], publishers, subscribers)
        self._update_services()

    @property
    def dropped(self) -> dict[str, int]:
        """What slow subscribers have missed, by topic."""
        counts = {name: outlet.dropped for name, outlet in tuple(self._outlets.items())}
        return {name: count for name, count in counts.items() if count}

    def close(self) -> None:
        """Take everything back."""
        for inlet in self._inlets.values():
            inlet.unregister()
        for service in self._services.values():
            service.shutdown()
        self._pump.close()
        for outlet in self._outlets.values():
            outlet.close()
        self._session.close()

    # ------------------------------------------------------------------------------------ topics

    def _publishers(self, topic: TopicInfo) -> int:
        """How many others publish a topic in the graph."""
        return topic.publishers - (self._session.published_type(topic.name) is not None)

    def _subscribers(self, topic: TopicInfo) -> int:
        """How many others subscribe to it."""
        outlet = self._outlets.get(topic.name)
        return topic.subscribers - (outlet is not None and outlet.holds)

    def _update_outlet(self, topic: TopicInfo, publishers: int) -> None:
        outlet = self._outlets.get(topic.name)
        if outlet is None:
            if publishers and self._speaks(topic):
                names = topic.name, topic.msgtype
                self._outlets[topic.name] = Outlet(
                    self.node, self._session, self._pump, names, latched=topic.latched
                )
        elif not outlet.is_current:
            outlet.wake()

    def _update_inlet(self, topic: TopicInfo, publishers: int, subscribers: int) -> None:
        name = topic.name
        takes = self._sharing.takes(name, publishers, subscribers)
        if takes and name not in self._inlets and self._speaks(topic):
            self._inlets[name] = self.node.subscriber(name, topic.msgtype, self._receive(topic))
        elif not takes and name in self._inlets:
            self._inlets.pop(name).unregister()
            if self._session.published_type(name) is not None:
                self._session.unadvertise(name)

    def _receive(self, topic: TopicInfo) -> Any:
        name, msgtype = topic.name, topic.msgtype
        decode = ros1_codec().decode

        def receive(data: bytes, sender: str) -> None:
            if sender == self.node.name:
                return  # what the graph itself publishes
            try:
                message = decode(data, msgtype)
                outlet = self._outlets.get(name)
                if outlet is not None:
                    outlet.leave_out(message)
                self._session.advertise(name, msgtype)
                self._session.publish(name, message)
            except GraphError as error:
                self._refuse(name, error)

        return receive

    def _speaks(self, topic: TopicInfo) -> bool:
        """Whether ROS 1 has a form of the topic's type."""
        if topic.name in self._refused:
            return False
        try:
            ros1_codec().learn(topic.msgtype)
            ros1_codec().md5(topic.msgtype)
        except GraphError as error:
            self._refuse(topic.name, error)
            return False
        return True

    def _refuse(self, name: str, error: Exception) -> None:
        """Say once what cannot be shared."""
        if name not in self._refused:
            self._refused.add(name)
            _log.warning("ROS 1: %s: %s", name, error)

    # ---------------------------------------------------------------------------------- services

    def offer_remote(self, services: Mapping[str, str]) -> None:
        """Offer ROS 1 services in the graph. `GraphError` for a wrong type or a taken name."""
        for name, srvtype in services.items():
            self._session.offer(name, srvtype, self._caller(name, srvtype))
            self._remote.add(name)

    def _caller(self, name: str, srvtype: str) -> Any:
        def handle(request: Any, reply: Reply) -> None:
            def ask() -> None:
                try:
                    reply.answer(self.node.call(name, srvtype, request))
                except GraphError as error:
                    reply.fail(error)
                except Exception as error:  # whoever asked must hear of it
                    reply.fail(GraphError(f"service '{name}': {error}"))

            threading.Thread(target=ask, name=f"volery-ros1 {name}", daemon=True).start()

        return handle

    def _update_services(self) -> None:
        offered = {
            name: srvtype
            for name, srvtype in self._session.graph.services().items()
            if name not in self._remote and self._sharing.has(name)
        }
        for name in [name for name in self._services if name not in offered]:
            self._services.pop(name).shutdown()
        for name, srvtype in offered.items():
            if name in self._services or name in self._refused:
                continue
            try:
                self._services[name] = self.node.service(name, srvtype, self._answerer(name))
            except GraphError as error:
                self._refuse(name, error)

    def _answerer(self, name: str) -> Any:
        def answer(request: Any) -> Any:
            come: Future[Any] = Future()
            self._session.call(name, request, Reply(come.set_result, come.set_exception))
            try:
                return come.result(_SERVICE_TIMEOUT_S)
            except FutureTimeout:
                text = f"service '{name}' did not answer within {_SERVICE_TIMEOUT_S:.0f} s"
                raise GraphError(text) from None

        return answer
