"""Publishes which nodes have which endpoints, as rmw_dds_common does.

DDS has participants and endpoints but no nodes. Every participant therefore publishes its nodes on
the latched topic `ros_discovery_info`.
"""

from __future__ import annotations

import threading
from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from volery.bridges.ros2.dds import library
from volery.bridges.ros2.dds.idl_types import message_struct
from volery.bridges.ros2.dds.qos import qos_of
from volery.bridges.ros2.middleware import Profile
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.type_hashes import message_hash
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.messages import message_type

TOPIC = "ros_discovery_info"
TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_NODE_TYPE = "rmw_dds_common/msg/NodeEntitiesInfo"
_GID_TYPE = "rmw_dds_common/msg/Gid"
PROFILE = Profile(latched=True, depth=1)


class DiscoveryInfo:
    """The nodes of one participant and their endpoints; `publish` sends changes."""

    def __init__(self, participant: DomainParticipant) -> None:
        self._gid = participant.guid.bytes
        self._nodes: dict[NodeName, tuple[list[bytes], list[bytes]]] = {}
        self._lock = threading.Lock()
        self._stale = True
        topic = Topic(participant, TOPIC, message_struct(TYPE))
        user_data = f"typehash={message_hash(TYPE)};".encode()
        self._writer = DataWriter(participant, topic, qos=qos_of(PROFILE, user_data))

    def add_node(self, node: NodeName) -> None:
        """Adds a node."""
        with self._lock:
            self._nodes.setdefault(node, ([], []))
            self._stale = True

    def remove_node(self, node: NodeName) -> None:
        """Removes a node."""
        with self._lock:
            self._stale = self._nodes.pop(node, None) is not None or self._stale

    def add(self, node: NodeName, entity: Any, *, writes: bool) -> None:
        """Adds an endpoint of a node."""
        with self._lock:
            self._nodes.setdefault(node, ([], []))[writes].append(entity.guid.bytes)
            self._stale = True

    def remove(self, node: NodeName, entity: Any, *, writes: bool) -> None:
        """Removes an endpoint, before it is deleted."""
        gid = entity.guid.bytes
        with self._lock:
            gids = self._nodes.get(node, ([], []))[writes]
            if gid in gids:
                gids.remove(gid)
                self._stale = True

    def publish(self) -> None:
        """Publishes the nodes if they have changed."""
        with self._lock:
            if not self._stale:
                return
            self._stale = False
            message = record_message(self._gid, self._nodes)
            library.write(self._writer, encode_cdr(message, TYPE))


def record_message(gid: bytes, nodes: dict[NodeName, tuple[list[bytes], list[bytes]]]) -> Any:
    """Returns the record of a participant; nodes: its readers and writers by node."""
    entry = message_type(_NODE_TYPE)
    return message_type(TYPE)(
        _gid(gid),
        [
            entry(node.namespace, node.name, [_gid(r) for r in readers], [_gid(w) for w in writers])
            for node, (readers, writers) in nodes.items()
        ],
    )


def _gid(data: bytes) -> Any:
    import numpy as np

    return message_type(_GID_TYPE)(np.frombuffer(data, np.uint8))
