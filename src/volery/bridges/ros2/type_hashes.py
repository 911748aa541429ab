"""Type hashes of ROS 2 (REP-2011, RIHS01), which identify equal types of two peers.

A hash is the SHA-256 of the type's description as JSON, with the descriptions of all types in it,
in the form of `rosidl_generator_type_description`.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from volery.graph.typestore import typestore

UNKNOWN = "RIHS01_" + "0" * 64
"""Hash of a type without one."""

# type_description_interfaces/msg/FieldType
_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "char": 3,  # ROS 2 maps its char to uint8
    "bool": 15,
    "byte": 16,
    "octet": 16,
    "string": 17,
    "wstring": 18,
}
_NESTED = 1
_BOUNDED_STRING = 21
_ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 48, 96, 144
"""Offsets to the number of an element's type."""
_MEMBER = "structure_needs_at_least_one_member"

_Fields = list[tuple[str, Any]]


@cache
def message_hash(msgtype: str) -> str:
    """Returns `RIHS01_...` of a message type. Raises `KeyError` if it is unknown."""
    return _hash(msgtype, {})


@cache
def service_hash(srvtype: str) -> str:
    """Returns `RIHS01_...` of a service type, which consists of request, response and event.

    srvtype: `std_srvs/srv/Trigger`, or a service of an action, `pkg/action/Name_SendGoal`.
    """
    parts = {part: f"{srvtype}_{part}" for part in ("Request", "Response", "Event")}
    made: dict[str, _Fields] = {
        srvtype: [
            ("request_message", _name(parts["Request"])),
            ("response_message", _name(parts["Response"])),
            ("event_message", _name(parts["Event"])),
        ],
        parts["Event"]: [
            ("info", _name("service_msgs/msg/ServiceEventInfo")),
            ("request", (Nodetype.SEQUENCE, (_name(parts["Request"]), 1))),
            ("response", (Nodetype.SEQUENCE, (_name(parts["Response"]), 1))),
        ],
    }
    return _hash(srvtype, made)


def _name(msgtype: str) -> Any:
    return (Nodetype.NAME, msgtype)


def _hash(msgtype: str, made: dict[str, _Fields]) -> str:
    """Returns the hash of a type; made: fields of types that no store has."""
    described: dict[str, Any] = {}

    def describe(name: str) -> None:
        if name in described:
            return
        described[name] = None  # types do not contain themselves; this one is in progress
        fields = made.get(name) or typestore().fielddefs[name][1]
        if not fields:
            fields = [(_MEMBER, (Nodetype.BASE, ("uint8", 0)))]
        described[name] = {"type_name": name, "fields": [_field(*field) for field in fields]}
        for _, kind in fields:
            nested = _field("", kind)["type"]["nested_type_name"]
            if nested:
                describe(nested)

    describe(msgtype)
    whole = {
        "type_description": described.pop(msgtype),
        "referenced_type_descriptions": [described[name] for name in sorted(described)],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(whole).encode()).hexdigest()}"


def _field(name: str, described: Any) -> dict[str, Any]:
    """Returns a field in the form of `rosidl` from that of `rosbags`."""
    kind, detail = described
    added, capacity = 0, 0
    if kind == Nodetype.ARRAY:
        (kind, detail), capacity = detail
        added = _ARRAY
    elif kind == Nodetype.SEQUENCE:
        (kind, detail), capacity = detail
        added = _BOUNDED_SEQUENCE if capacity else _SEQUENCE
    nested, letters = "", 0
    if kind == Nodetype.NAME:
        number, nested = _NESTED, detail
    elif detail[0] == "string" and detail[1]:
        number, letters = _BOUNDED_STRING, detail[1]
    else:
        number = _TYPE_IDS[detail[0]]
    return {
        "name": name,
        "type": {
            "type_id": number + added,
            "capacity": capacity,
            "string_capacity": letters,
            "nested_type_name": nested,
        },
    }
