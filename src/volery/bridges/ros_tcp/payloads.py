"""Encodes messages of ROS 1 or ROS 2 in ROS-TCP frames, with names in Unity's spelling."""

from __future__ import annotations

from typing import Any, Protocol

from volery.bridges.ros_tcp.views import parts_of
from volery.bridges.ros_tcp.wire import Bytes, Generation
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import CODING_ERRORS, decode_cdr, encode_cdr
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.ros1_names import ros1_name, ros2_name
from volery.graph.messages import Published, message_type
from volery.graph.object_count import CDR, ROS1, check_objects
from volery.graph.typestore import typestore

_CDR_HEADER_BYTES = 4


class Payloads(Protocol):
    """Encodes and decodes messages."""

    def published(self, published: Published) -> list[Bytes]:
        """Returns the bytes of a message of the graph, in parts.

        Raises `GraphError` as `encode`.
        """

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Returns the bytes of a message.

        Raises `GraphError` if this generation cannot encode it.
        """

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """Returns the message. Raises `GraphError` for invalid bytes."""

    def learn(self, msgtype: str) -> None:
        """Prepares for a type, some milliseconds, so that its first message need not wait."""

    def short(self, msgtype: str) -> str:
        """Returns Unity's name of a type: `std_msgs/String`, `std_srvs/SetBool`."""


class Ros1Payloads:
    """Plain ROS 1 serialization.

    limited: messages are from clients, and their number of objects is limited by `object_count`.
    """

    def __init__(self, *, limited: bool = False) -> None:
        self._limited = limited

    def published(self, published: Published) -> list[Bytes]:
        """Returns the bytes of a message of the graph, in parts.

        Raises `GraphError` as `encode`.
        """
        return parts_of(published, self.encode) or [published.ros1]

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Returns the bytes of a message. Raises `GraphError` if it does not fit its type."""
        return ros1_codec().encode(message, msgtype)

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """Returns the message. Raises `GraphError` for invalid bytes."""
        if self._limited:
            check_objects(data, msgtype, ROS1)
        return ros1_codec().decode(data, msgtype)

    def learn(self, msgtype: str) -> None:
        """Prepares for a type, some milliseconds, so that its first message need not wait."""
        ros1_codec().learn(msgtype)

    def short(self, msgtype: str) -> str:
        """Returns Unity's name of a type."""
        return ros1_name(msgtype)


class Ros2Payloads:
    """CDR with its header of four bytes; `limited` as in `Ros1Payloads`."""

    def __init__(self, *, limited: bool = False) -> None:
        self._limited = limited

    def published(self, published: Published) -> list[Bytes]:
        """Returns the bytes of a message of the graph, in parts.

        Raises `GraphError` as `encode`.
        """
        try:
            return parts_of(published, self.encode) or [published.cdr]
        except (*CODING_ERRORS, AssertionError) as error:
            raise GraphError(f"the message does not fit {published.msgtype}: {error}") from None

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Returns the bytes of a message. Raises `GraphError` if it does not fit its type."""
        return encode_cdr(message, msgtype)

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """Returns the message. Raises `GraphError` for invalid bytes."""
        if len(data) == _CDR_HEADER_BYTES and not _has_fields(msgtype):
            data = bytes(data) + b"\0"  # Unity leaves out the byte of an empty message
        if self._limited:
            check_objects(data, msgtype, CDR)
        return decode_cdr(data, msgtype)

    def learn(self, msgtype: str) -> None:
        """Prepares for a type, some milliseconds, so that its first message need not wait."""
        typestore().get_msgdef(msgtype)

    def short(self, msgtype: str) -> str:
        """Returns Unity's name of a type."""
        package, _, plain = msgtype.split("/")
        return f"{package}/{plain}"


def payloads_of(generation: Generation, *, limited: bool = False) -> Payloads:
    """Returns the payloads of a generation of ROS. Raises `BridgeError` for an unknown name.

    limited: messages are from clients, and are refused if decoding would take too long.
    """
    if generation not in _KINDS:
        raise BridgeError(f"generation must be 'ros1' or 'ros2', not '{generation}'")
    return _KINDS[generation](limited=limited)


def topic_type(name: str) -> str:
    """Returns `std_msgs/msg/String` for Unity's `std_msgs/String`.

    Raises `GraphError` if unknown.
    """
    return _known(ros2_name(name, "msg"), "")


def service_type(name: str) -> str:
    """Returns `std_srvs/srv/SetBool` for Unity's `std_srvs/SetBool`.

    Raises `GraphError` if unknown.
    """
    return _known(ros2_name(name, "srv"), "_Request")


def absolute(name: str) -> str:
    """Returns a name in the graph: `cmd_vel` in Unity projects means `/cmd_vel`."""
    return name if name.startswith("/") else f"/{name}"


def _known(name: str, ending: str) -> str:
    try:
        message_type(name + ending)
    except KeyError:
        raise GraphError(f"unknown type '{name}'") from None
    return name


def _has_fields(msgtype: str) -> bool:
    _, fields = typestore().fielddefs[msgtype]
    return any(name != EMPTY_MEMBER for name, _ in fields)


_KINDS: dict[str, type[Ros1Payloads] | type[Ros2Payloads]] = {
    "ros1": Ros1Payloads,
    "ros2": Ros2Payloads,
}
