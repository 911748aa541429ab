"""Keys, liveliness tokens and attachments of rmw_zenoh.

https://github.com/ros2/rmw_zenoh/blob/rolling/docs/design.md
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from volery.bridges.ros2.middleware import Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName, dds_type, ros_type
from volery.bridges.ros2.type_hashes import message_hash, service_hash

SPACE = "@ros2_lv"
NODE, PUBLISHER, SUBSCRIPTION, SERVER, CLIENT = "NN", "MP", "MS", "SS", "SC"

_SLASH = "%"
_RELIABLE, _BEST_EFFORT = 1, 2  # rmw_qos_reliability_policy_e
_TRANSIENT_LOCAL, _VOLATILE = 1, 2  # rmw_qos_durability_policy_e
_KEEP_LAST = 1  # rmw_qos_history_policy_e
_REST = ",:,:,,"
"""Deadline, lifespan and liveliness: at their defaults."""
_ENDPOINT_PARTS = 13
_MAX_DIGITS = 10
_ATTACHMENT = struct.Struct("<qqB16s")
GID_BYTES = 16


class ZenohEndpoint(NamedTuple):
    """Content of a liveliness token of a publisher, subscription, server or client."""

    session: str
    kind: str
    node: NodeName
    name: str
    msgtype: str
    """For a service: the service's type."""
    type_hash: str
    profile: Profile


class Attachment(NamedTuple):
    """Attachment of every message, request and response."""

    number: int
    time_ns: int
    """Unix time."""
    gid: bytes

    def encode(self) -> bytes:
        """Returns the 33 bytes of the attachment."""
        return _ATTACHMENT.pack(self.number, self.time_ns, GID_BYTES, self.gid)

    @classmethod
    def decode(cls, data: bytes) -> Attachment | None:
        """Returns the attachment in bytes; None if they are invalid."""
        if len(data) != _ATTACHMENT.size:
            return None
        number, time_ns, length, gid = _ATTACHMENT.unpack(data)
        return cls(number, time_ns, gid) if length == GID_BYTES else None


def topic_key(domain_id: int, topic: str, msgtype: str) -> str:
    """Returns the key of a topic's messages."""
    return f"{domain_id}/{topic.strip('/')}/{dds_type(msgtype)}/{message_hash(msgtype)}"


def service_key(domain_id: int, service: str, srvtype: str) -> str:
    """Returns the key of a service's requests."""
    return f"{domain_id}/{service.strip('/')}/{dds_type(srvtype)}/{service_hash(srvtype)}"


def node_token(domain_id: int, session: str, number: int, node: NodeName) -> str:
    """Returns the token of a node; number: its own within the session."""
    return f"{SPACE}/{domain_id}/{session}/{number}/{number}/{NODE}/{_node_words(node)}"


def topic_token(
    domain_id: int, session: str, ids: tuple[int, int], kind: str, spec: TopicSpec
) -> str:
    """Returns the token of a publisher or subscription; ids: those of its node and its own."""
    what = f"{dds_type(spec.msgtype)}/{message_hash(spec.msgtype)}/{qos_words(spec.profile)}"
    return _endpoint(domain_id, session, ids, kind, spec.node, spec.topic, what)


def service_token(
    domain_id: int, session: str, ids: tuple[int, int], kind: str, spec: ServiceSpec
) -> str:
    """Returns the token of a server or client; ids: those of its node and its own."""
    what = f"{dds_type(spec.srvtype)}/{service_hash(spec.srvtype)}/{qos_words(Profile())}"
    return _endpoint(domain_id, session, ids, kind, spec.node, spec.service, what)


def _endpoint(
    domain_id: int,
    session: str,
    ids: tuple[int, int],
    kind: str,
    node: NodeName,
    name: str,
    what: str,
) -> str:
    prefix = f"{SPACE}/{domain_id}/{session}/{ids[0]}/{ids[1]}/{kind}"
    return f"{prefix}/{_node_words(node)}/{_mangled(name)}/{what}"


def qos_words(profile: Profile) -> str:
    """Returns the complete text of a quality of service: `1:2:1,10:,:,:,,`."""
    reliability = _RELIABLE if profile.reliable else _BEST_EFFORT
    durability = _TRANSIENT_LOCAL if profile.latched else _VOLATILE
    return f"{reliability}:{durability}:{_KEEP_LAST},{profile.depth}:{_REST}"


def read_token(token: str) -> ZenohEndpoint | None:
    """Returns the endpoint of a token; None for nodes and invalid tokens."""
    parts = token.split("/")
    if len(parts) != _ENDPOINT_PARTS or parts[0] != SPACE:
        return None
    _, _, session, _, _, kind, _, namespace, name, topic, dds_name, type_hash, qos = parts
    msgtype = ros_type(dds_name)
    if msgtype is None or kind not in (PUBLISHER, SUBSCRIPTION, SERVER, CLIENT):
        return None
    node = NodeName(namespace.replace(_SLASH, "/"), name)
    plain = topic.replace(_SLASH, "/")
    return ZenohEndpoint(session, kind, node, plain, msgtype, type_hash, _read_qos(qos))


def _read_qos(words: str) -> Profile:
    """Returns the profile in a token's text, in which defaults may be missing: `::,10:,:,:,,`."""
    reliability, durability, history, *_ = [*words.split(":"), "", "", ""]
    depth = history.partition(",")[2]
    return Profile(
        reliable=reliability != str(_BEST_EFFORT),
        latched=durability == str(_TRANSIENT_LOCAL),
        depth=int(depth) if depth.isdecimal() and len(depth) < _MAX_DIGITS else Profile().depth,
    )


def _node_words(node: NodeName) -> str:
    """Returns enclave, namespace and name of a node."""
    return f"{_SLASH}/{_mangled(node.namespace)}/{node.name}"


def _mangled(name: str) -> str:
    return name.replace("/", _SLASH)
