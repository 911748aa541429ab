"""The graph's ROS 2 messages as ROS 1 bytes.

The two generations share most definitions. They differ in the header's `seq`, in a few fields that
ROS 2 added (`Range.variance`) or renamed (`CameraInfo.D` became `d`); types unknown to ROS 1 keep
their ROS 2 definition. A converter a type is built once from the two lists of fields; parts without
a difference are passed on as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from volery.core.errors import RecordingError

HEADER = "std_msgs/msg/Header"

Converter = Callable[[Any, int], Any]
"""ROS 2 message and the header's sequence number to a message that ROS 1 can serialize."""


class Ros1Encoder:
    """Serializes messages of a ROS 2 typestore for ROS 1."""

    def __init__(self, ros2: Typestore) -> None:
        self._ros2 = ros2
        self.typestore = get_typestore(Stores.ROS1_NOETIC)
        self._converters: dict[str, Converter | None] = {}

    def encode(self, message: Any, msgtype: str, sequence: int) -> memoryview:
        """ROS 1 bytes of a message; `sequence` becomes its header's `seq`."""
        try:
            convert = self._converters[msgtype]
        except KeyError:
            convert = self.learn(msgtype)
        if convert is not None:
            message = convert(message, sequence)
        return self.typestore.serialize_ros1(message, msgtype)

    def learn(self, msgtype: str) -> Converter | None:
        """Prepare a type, and those it is made of; None where ROS 1 takes the message as it is."""
        if msgtype not in self._converters:
            self._register(msgtype)
            self._converters[msgtype] = self._converter(msgtype)
        return self._converters[msgtype]

    def _register(self, msgtype: str) -> None:
        if msgtype in self.typestore.fielddefs:
            return
        if msgtype not in self._ros2.fielddefs:
            raise RecordingError(f"message type {msgtype} is not known, so it cannot be recorded")
        definition = self._ros2.fielddefs[msgtype]
        for _, description in definition[1]:
            inner = _inner_type(description)
            if inner:
                self._register(inner)
        self.typestore.register({msgtype: definition})

    def _converter(self, msgtype: str) -> Converter | None:
        target: Any = self.typestore.types[msgtype]
        if msgtype == HEADER:
            return lambda m, sequence: target(sequence, m.stamp, m.frame_id)
        old_fields = self.typestore.fielddefs[msgtype][1]
        new_names = {name.lower(): name for name, _ in self._ros2.fielddefs[msgtype][1]}
        plan: list[tuple[str, Converter | None, bool]] = []
        for name, description in old_fields:
            if name.lower() not in new_names:
                raise RecordingError(f"{msgtype} has no field for ROS 1's '{name}'")
            inner = _inner_type(description)
            convert = self.learn(inner) if inner else None
            is_list = description[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            plan.append((new_names[name.lower()], convert, is_list))
        same_names = all(old == new for (old, _), (new, _, _) in zip(old_fields, plan, strict=True))
        if same_names and all(convert is None for _, convert, _ in plan):
            return None

        def build(message: Any, sequence: int) -> Any:
            values = []
            for name, convert, is_list in plan:
                value = getattr(message, name)
                if convert is not None:
                    if is_list:
                        value = [convert(item, sequence) for item in value]
                    else:
                        value = convert(value, sequence)
                values.append(value)
            return target(*values)

        return build


def _inner_type(description: Any) -> str | None:
    """Name of the message type of a field, or of its elements; None for numbers and strings."""
    kind, detail = description
    if kind == Nodetype.NAME:
        return str(detail)
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return _inner_type(detail[0])
    return None
