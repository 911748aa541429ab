"""The bridge to native ROS 1: joins a real roscore through rospy.

    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(Ros1Bridge())
        simulation.run(speed=1.0)

Topics that the graph publishes appear in ROS 1 under the same names; topics that it subscribes to
are received from ROS 1. ROS 1 nodes can call its services, and the graph can call ROS 1 services
that are named to the bridge. Without rospy the bridge does not open and reports what to install.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from volery.bridges.ros1.graph_sync import GraphSync
from volery.bridges.ros1.node import join_ros1
from volery.bridges.shared_names import COMMANDS, SharedNames
from volery.core.errors import BridgeError
from volery.graph.session import Gateway

_SURVEY_S = 0.25
_MASTER_EACH = 4
"""Surveys between two queries to the master."""
_USE_SIM_TIME = "/use_sim_time"

_log = logging.getLogger(__name__)


class Ros1Bridge:
    """The whole simulation as one ROS 1 node; a `graph.bridge_kind.Bridge`.

    Parameters
    ----------
    master_uri, host, anywhere
        See `ros1_node.join_ros1`.
    node_name
        Name of the node.
    topics
        Patterns of the names of shared topics and services, as in `fnmatch`.
    commands
        Patterns of topics that ROS 1 may publish besides publishers of the graph.
    remote_services
        ROS 1 services that the graph can call, and their types (`std_srvs/srv/Trigger`).
    use_sim_time
        Whether to set this parameter while the bridge is open, so that nodes started meanwhile
        follow the simulation's `/clock`. The previous value is restored afterwards.

    """

    def __init__(
        self,
        master_uri: str | None = None,
        node_name: str = "volery",
        *,
        topics: Sequence[str] = ("*",),
        commands: Sequence[str] = COMMANDS,
        remote_services: Mapping[str, str] | None = None,
        use_sim_time: bool = True,
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
        self._bridge: GraphSync | None = None
        self._steward: threading.Thread | None = None
        self._stopping = threading.Event()

    @property
    def dropped(self) -> dict[str, int]:
        """Number of messages that slow ROS 1 subscribers missed, by topic, without zeros."""
        return {} if self._bridge is None else self._bridge.dropped

    async def start(self, gateway: Gateway) -> None:
        """Joins the ROS 1 graph. Raises `BridgeError` without rospy or a master."""
        await asyncio.get_running_loop().run_in_executor(None, self._begin, gateway)

    async def stop(self) -> None:
        """Unregisters all topics and services; the node remains until the process ends."""
        await asyncio.get_running_loop().run_in_executor(None, self._end)

    def _begin(self, gateway: Gateway) -> None:
        arguments: Any = self._address
        node = join_ros1(self._node_name, **arguments)
        self.name = f"ROS 1 node {node.name} at {node.master.uri}"
        names = SharedNames(self._patterns, self._commands)
        self._bridge = GraphSync(node, gateway.open(self.name), names)
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
        """Updates the shared names, and registers again with a new master."""
        bridge, count, away = self._bridge, 0, False
        while bridge is not None and not self._stopping.wait(_SURVEY_S) and bridge.node.alive:
            count += 1
            if not threading.main_thread().is_alive():
                bridge.close()  # else rospy's threads would keep the process alive
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
            except Exception as error:  # an error of one topic must not end the bridge
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
        """Restores the parameter: later nodes would wait for a missing clock."""
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
