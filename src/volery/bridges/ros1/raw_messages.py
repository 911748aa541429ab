"""Message and service classes for rospy that carry encoded bytes.

rospy asks a class for its name, md5 sum and definition, and serializes its instances. These classes
take the first three from the graph's types and write bytes that were encoded elsewhere, so that
types without an installed ROS 1 package work too, and no field is packed by itself.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from volery.bridges.ros1.environment import load_rospy
from volery.graph.codecs.ros1 import ros1_codec, ros1_name


@cache
def raw_message_class(msgtype: str) -> Any:
    """Returns the class of a type such as `nav_msgs/msg/Odometry`, or of a service's part.

    Its instances have `data`, the ROS 1 bytes. Raises `GraphError` for an unknown type.
    """
    codec = ros1_codec()
    return type(
        ros1_name(msgtype).rpartition("/")[2],
        (load_rospy().Message,),
        {
            "__slots__": ["data"],
            "__init__": _init,
            "serialize": _serialize,
            "deserialize": _deserialize,
            "_type": ros1_name(msgtype),
            "_md5sum": codec.md5(msgtype),
            "_full_text": codec.definition_text(msgtype),
            "_has_header": False,  # the bytes have their sequence number already
            "_slot_types": ["uint8[]"],
        },
    )


@cache
def raw_service_class(srvtype: str) -> Any:
    """Returns the class of a service such as `std_srvs/srv/SetBool`.

    Raises `GraphError` for an unknown type.
    """
    return type(
        ros1_name(srvtype).rpartition("/")[2],
        (),
        {
            "_type": ros1_name(srvtype),
            "_md5sum": ros1_codec().md5(srvtype),
            "_request_class": raw_message_class(f"{srvtype}_Request"),
            "_response_class": raw_message_class(f"{srvtype}_Response"),
        },
    )


def _init(self: Any, data: bytes = b"") -> None:
    self.data = data


def _serialize(self: Any, buffer: Any) -> None:
    buffer.write(self.data)


def _deserialize(self: Any, data: bytes) -> Any:
    self.data = data
    return self
