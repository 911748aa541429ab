"""What ROS-TCP frames carry: messages of ROS 1 or ROS 2, and names as Unity spells them."""

from __future__ import annotations

from typing import Any, Protocol

from volery.bridges.ros_tcp.views import parts_of
from volery.bridges.ros_tcp.wire import Bytes, Generation
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import CODING_ERRORS, decode_cdr, encode_cdr
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.ros1_names import ros1_name, ros2_name
from volery.graph.messages import Published, message_type, typestore
from volery.graph.object_count import CDR, ROS1, check_objects

_CDR_HEADER_BYTES = 4


class Payloads(Protocol):
    """How messages become bytes and come back."""

    def published(self, published: Published) -> list[Bytes]:
        """Bytes of a message of the graph, in parts; `GraphError` as `encode`."""

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Bytes of a message; `GraphError` where it cannot be said in this generation."""

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """The message; `GraphError` where the bytes are none."""

    def learn(self, msgtype: str) -> None:
        """Prepare for a type, some milliseconds, that its first message need not wait."""

    def short(self, msgtype: str) -> str:
        """Name of a type as Unity writes it: `std_msgs/String`, `std_srvs/SetBool`."""


class Ros1Payloads:
    """Plain ROS 1 serialization.

    limited: messages come from clients, and may become no more objects than `object_count` allows.
    """

    def __init__(self, *, limited: bool = False) -> None:
        self._limited = limited

    def published(self, published: Published) -> list[Bytes]:
        """Bytes of a message of the graph, in parts; `GraphError` as `encode`."""
        return parts_of(published, self.encode) or [published.ros1]

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Bytes of a message; `GraphError` where it does not fit its type."""
        return ros1_codec().encode(message, msgtype)

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """The message; `GraphError` where the bytes are none."""
        if self._limited:
            check_objects(data, msgtype, ROS1)
        return ros1_codec().decode(data, msgtype)

    def learn(self, msgtype: str) -> None:
        """Prepare for a type, some milliseconds, that its first message need not wait."""
        ros1_codec().learn(msgtype)

    def short(self, msgtype: str) -> str:
        """Name of a type as Unity writes it."""
        return ros1_name(msgtype)


class Ros2Payloads:
    """CDR with its header of four bytes; `limited` as of `Ros1Payloads`."""

    def __init__(self, *, limited: bool = False) -> None:
        self._limited = limited

    def published(self, published: Published) -> list[Bytes]:
        """Bytes of a message of the graph, in parts; `GraphError` as `encode`."""
        try:
            return parts_of(published, self.encode) or [published.cdr]
        except (*CODING_ERRORS, AssertionError) as error:
            raise GraphError(f"the message does not fit {published.msgtype}: {error}") from None

    def encode(self, message: Any, msgtype: str) -> bytes:
        """Bytes of a message; `GraphError` where it does not fit its type."""
        return encode_cdr(message, msgtype)

    def decode(self, data: Bytes, msgtype: str) -> Any:
        """The message; `GraphError` where the bytes are none."""
        if len(data) == _CDR_HEADER_BYTES and not _has_fields(msgtype):
            data = bytes(data) + b"\0"  # Unity leaves out the byte that stands for nothing
        if self._limited:
            check_objects(data, msgtype, CDR)
        return decode_cdr(data, msgtype)

    def learn(self, msgtype: str) -> None:
        """Prepare for a type, some milliseconds, that its first message need not wait."""
        typestore().get_msgdef(msgtype)

    def short(self, msgtype: str) -> str:
        """Name of a type as Unity writes it."""
        package, _, plain = msgtype.split("/")
        return f"{package}/{plain}"


def payloads_of(generation: Generation, *, limited: bool = False) -> Payloads:
    """The payloads of a generation of ROS; `BridgeError` if there is none of that name.

    limited: messages come from clients, and are refused where decoding would take too long.
    """
    if generation not in _KINDS:
        raise BridgeError(f"generation is 'ros1' or 'ros2', not '{generation}'")
    return _KINDS[generation](limited=limited)


def topic_type(name: str) -> str:
    """`std_msgs/msg/String` of Unity's `std_msgs/String`. `GraphError` if there is none such."""
    return _known(ros2_name(name, "msg"), "")


def service_type(name: str) -> str:
    """`std_srvs/srv/SetBool` of Unity's `std_srvs/SetBool`. `GraphError` if there is none such."""
    return _known(ros2_name(name, "srv"), "_Request")


def absolute(name: str) -> str:
    """A name as the graph knows it: Unity projects write `cmd_vel` and mean `/cmd_vel`."""
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
