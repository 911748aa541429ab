"""The process as a node of a ROS 1 graph, through rospy, which allows one node per process."""

from __future__ import annotations

import logging
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from volery.bridges.ros1.environment import load_rospy
from volery.bridges.ros1.master import Ros1Master
from volery.bridges.ros1.port_guards import guard_ports
from volery.bridges.ros1.raw_messages import raw_message_class, raw_service_class
from volery.bridges.ros1.registrar import Ros1Registrar
from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.core.network_access import check_address
from volery.graph.codecs.ros1 import ros1_codec, ros2_name

DEFAULT_MASTER = "http://127.0.0.1:11311"
_BULKY = {"Image", "CompressedImage", "PointCloud2", "OccupancyGrid", "Octomap"}
_QUEUES = (10, 500)
"""Messages that may wait for one slow reader: large ones, others."""
_RECEIVE_BYTES = 1 << 20
_HEADER_TIMEOUT_S = 3.0

_log = logging.getLogger(__name__)
_lock = threading.Lock()
_nodes: list[Ros1Node] = []

Receive = Callable[[bytes, str, bool], None]
"""Handles a message's bytes, the name of the sender's node, and whether the sender latches it."""


class Ros1Node:
    """The node. Any thread may call the methods; those that query the master may block."""

    def __init__(self, rospy: Any, name: str, master: Ros1Master) -> None:
        self.name = name
        self.master = master
        self._rospy = rospy
        self._registrar = Ros1Registrar(rospy, master, name)

    @property
    def alive(self) -> bool:
        """Whether the node is active; a second node of the same name ends the first."""
        return not self._rospy.is_shutdown()

    # ------------------------------------------------------------------------------------ topics

    def publisher(self, topic: str, msgtype: str, *, latched: bool = False) -> Any:
        """Returns a `rospy.Publisher` of raw messages. Raises `GraphError` for an unknown type."""
        made = raw_message_class(msgtype)
        depth = _QUEUES[0] if made.__name__ in _BULKY else _QUEUES[1]
        found: list[Any] = []
        listener = _listener(self._rospy, lambda: _hurry(found))
        publisher = self._rospy.Publisher(
            topic, made, subscriber_listener=listener, latch=latched, queue_size=depth
        )
        found.append(publisher)
        return publisher

    def outlet(
        self, topic: str, msgtype: str, on_change: Callable[[], None], *, latched: bool
    ) -> Any:
        """Returns a `rospy.Publisher` to whose connections the caller writes.

        on_change: called when subscribers have come or gone. latched: reported to subscribers.
        Raises `GraphError` for an unknown type.
        """
        publisher = self._rospy.Publisher(
            topic,
            raw_message_class(msgtype),
            subscriber_listener=_listener(self._rospy, on_change),
            headers={"latching": "1" if latched else "0"},
            queue_size=1,
        )
        publisher.impl.set_queue_size(None)  # no thread for each connection
        return publisher

    def subscriber(self, topic: str, msgtype: str, receive: Receive) -> Any:
        """Returns a `rospy.Subscriber`; `receive` is called in a thread of its own."""

        def call_back(raw: Any) -> None:
            header = raw._connection_header
            receive(raw.data, header.get("callerid", ""), header.get("latching") == "1")

        made = raw_message_class(msgtype)
        return self._rospy.Subscriber(
            topic, made, call_back, buff_size=_RECEIVE_BYTES, tcp_nodelay=True
        )

    def topic_type(self, topic: str) -> str | None:
        """Returns the ROS 2 name of the master's type of a topic; None if unknown."""
        found = dict(self._ask_master("getTopicTypes")).get(topic)
        return None if found is None or found == "*" else ros2_name(found)

    # ---------------------------------------------------------------------------------- services

    def service(self, service: str, srvtype: str, handle: Callable[[Any], Any]) -> Any:
        """Creates a service: returns a `rospy.Service`, which ends with `shutdown()`.

        `handle(request)` returns the response, in a thread of its own; its `GraphError` becomes the
        caller's error.
        """
        codec = ros1_codec()
        made = raw_service_class(srvtype)

        def answer(raw: Any) -> Any:
            try:
                response = handle(codec.decode(raw.data, f"{srvtype}_Request"))
                return made._response_class(codec.encode(response, f"{srvtype}_Response"))
            except GraphError as error:
                raise self._rospy.ServiceException(str(error)) from None

        return self._rospy.Service(service, made, answer)

    def call(self, service: str, srvtype: str, request: Any) -> Any:
        """Calls a service of another node and waits for its response.

        Raises `GraphError` without one.
        """
        codec = ros1_codec()
        made = raw_service_class(srvtype)
        raw = made._request_class(codec.encode(request, f"{srvtype}_Request"))
        try:
            response = self._rospy.ServiceProxy(service, made)(raw)
        except (self._rospy.ServiceException, self._rospy.ROSException, OSError) as error:
            raise GraphError(f"service '{service}': {error}") from None
        return codec.decode(response.data, f"{srvtype}_Response")

    def service_type(self, service: str) -> str:
        """Returns the ROS 2 name of the type of another node's service.

        Raises `GraphError` if the service has no server.
        """
        network = self._rospy.core.rosgraph.network
        try:
            address = self.master.ask("lookupService", service).removeprefix("rosrpc://")
            host, _, port = address.rstrip("/").rpartition(":")
            with socket.create_connection((host, int(port)), _HEADER_TIMEOUT_S) as connection:
                request = {"probe": "1", "md5sum": "*", "callerid": self.name, "service": service}
                network.write_ros_handshake_header(connection, request)
                buffer = self._rospy.impl.tcpros_base.BytesIO()
                header = network.read_ros_handshake_header(connection, buffer, 4096)
            return ros2_name(header["type"], "srv")
        except BridgeError:
            raise GraphError(f"service '{service}' has no server") from None
        except (OSError, ValueError, KeyError, network.ROSHandshakeException) as error:
            raise GraphError(f"service '{service}': {error}") from None

    # ------------------------------------------------------------------------------------ master

    def _ask_master(self, method: str, *arguments: Any) -> Any:
        """Queries the master. Raises `GraphError` if it does not answer."""
        try:
            return self.master.ask(method, *arguments)
        except (OSError, BridgeError) as error:
            raise GraphError(f"ROS master: {error}") from None

    def register_again(self) -> bool:
        """Registers everything again if the master has lost it; returns whether it had.

        May raise `OSError`.
        """
        return self._registrar.register_again()


def join_ros1(
    name: str, *, master_uri: str | None = None, host: str | None = None, anywhere: bool = False
) -> Ros1Node:
    """Returns the process's node, created on the first call; it ends with the process.

    Parameters
    ----------
    name
        Name of the node, without a slash.
    master_uri
        Address of the master; default: `ROS_MASTER_URI`, else this machine.
    host
            Address of this machine for other nodes; default: `ROS_HOSTNAME` or `ROS_IP`, else
            127.0.0.1. rospy listens on all addresses unless this one is loopback's.
    anywhere
        Whether other machines may connect to this node.

    Raises
    ------
    BridgeError
        rospy is not installed, no master answers, or the process is another node already.

    """
    uri = (master_uri or os.environ.get("ROS_MASTER_URI") or DEFAULT_MASTER).rstrip("/")
    with _lock:
        rospy = load_rospy()
        master = Ros1Master(uri, f"/{name}")
        if _nodes:
            node = _nodes[0]
            if (node.name, node.master.uri) != (f"/{name}", uri) or not node.alive:
                state = "is" if node.alive else "was (until another node took its name)"
                raise BridgeError(
                    f"this process {state} ROS 1 node {node.name} at {node.master.uri}, and rospy "
                    "allows one node per process: start another process"
                )
            return node
        _set_address(host, anywhere=anywhere)
        _check_master(master)
        _warn_of_loopback(master)
        _begin(rospy, name, uri)
        _nodes.append(Ros1Node(rospy, f"/{name}", master))
        return _nodes[0]


def _check_master(master: Ros1Master) -> None:
    """Checks for a master, because rospy would wait for one without end."""
    try:
        master.ask("getPid")
    except OSError as error:
        raise UnreachableError(
            f"no ROS master answers at {master.uri} ({error}); start roscore, or rosmaster --core"
        ) from None


def _set_address(host: str | None, *, anywhere: bool) -> None:
    """Sets this machine's address for rospy, which reads only the environment."""
    given = host or os.environ.get("ROS_HOSTNAME") or os.environ.get("ROS_IP") or "127.0.0.1"
    check_address(given, anywhere=anywhere, flag="anywhere=True or --allow-remote")
    if host is not None or not (os.environ.get("ROS_HOSTNAME") or os.environ.get("ROS_IP")):
        os.environ.pop("ROS_HOSTNAME", None)
        os.environ["ROS_IP"] = given


def _warn_of_loopback(master: Ros1Master) -> None:
    """Warns if nodes of a remote master cannot connect to this one."""
    own = os.environ.get("ROS_HOSTNAME") or os.environ.get("ROS_IP") or ""
    if not (own == "localhost" or own.startswith("127.")):
        return
    try:
        there = socket.gethostbyname(master.host)
    except OSError:
        return
    if not there.startswith("127."):
        _log.warning(
            "the ROS master is at %s, and nodes of other machines cannot reach this one at %s; "
            "set ROS_IP or host",
            master.host,
            own,
        )


def _begin(rospy: Any, name: str, uri: str) -> None:
    os.environ["ROS_MASTER_URI"] = uri
    guard_ports()
    setting = "ROS_PYTHON_LOG_CONFIG_FILE"
    before = os.environ.get(setting)
    os.environ[setting] = before or str(Path(__file__).with_name("logging.yaml"))
    try:
        rospy.init_node(
            name, argv=[name], disable_signals=True, disable_rostime=True, disable_rosout=True
        )
    except (rospy.ROSException, ValueError) as error:
        raise BridgeError(f"cannot become ROS 1 node '{name}': {error}") from None
    finally:
        if before is None:
            del os.environ[setting]


def _hurry(publishers: list[Any]) -> None:
    """Disables Nagle's algorithm, as rospy does only for subscribers that ask for it."""
    for publisher in publishers:
        for connection in publisher.impl.connections if publisher.impl else ():
            try:
                with socket.socket(fileno=os.dup(connection.fileno())) as same:
                    same.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except (OSError, TypeError):  # closing
                continue


def _listener(rospy: Any, on_change: Callable[[], None]) -> Any:
    """Returns a listener of rospy's class."""

    class Listener(rospy.SubscribeListener):  # type: ignore[misc]
        """Forwards to `on_change`."""

        def peer_subscribe(self, *_: Any) -> None:
            on_change()

        def peer_unsubscribe(self, *_: Any) -> None:
            on_change()

    return Listener()
