"""Reads the fields of a rosbridge operation."""

from __future__ import annotations

import math
from typing import Any

from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError
from volery.graph.qos import (
    DEFAULT_DEPTH,
    MAX_DEPTH,
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

Id = str | int | float | None
"""Client's name of an operation, returned unchanged."""

MAX_FRAGMENT = 1e9
"""Largest size of fragments, characters; no message is as long."""
MAX_NAME_LENGTH = 1000
"""Largest number of characters of a name or an id."""


def read_text(operation: Operation, key: str) -> str:
    """Returns a required text. Raises `BridgeError` otherwise."""
    value = operation.get(key)
    if not isinstance(value, str) or not value:
        raise BridgeError(f"{operation['op']}: '{key}' must be text and not empty")
    if len(value) > MAX_NAME_LENGTH:
        raise BridgeError(f"{operation['op']}: '{key}' has more than {MAX_NAME_LENGTH} characters")
    return value


def read_optional_text(operation: Operation, key: str) -> str | None:
    """Returns a text; None if missing, null or empty. Raises `BridgeError` for other values."""
    if operation.get(key) in (None, ""):
        return None
    return read_text(operation, key)


def read_id(operation: Operation) -> Id:
    """Returns the operation's id. Raises `BridgeError` if it is neither text nor number."""
    value = operation.get("id")
    if value is None or (isinstance(value, str) and len(value) <= MAX_NAME_LENGTH):
        return value
    if isinstance(value, (int, float)) and abs(value) < 2**63:
        return value
    raise BridgeError(f"{operation['op']}: 'id' must be text or a number")


class NeedlessOperationError(BridgeError):
    """An operation ends what does not exist: no harm is done, and rosbridge warns at most."""


def read_limit(operation: Operation, key: str, greatest: float) -> float:
    """Returns a limit that the client sets, 0 if missing; at most `greatest`.

    Clients such as ROS# send the largest integer where they set no limit. Raises `BridgeError` for
    a negative number, NaN and other values.
    """
    return min(read_number(operation, key, 0.0, 0.0, math.inf), greatest)


def read_number(
    operation: Operation, key: str, default: float, minimum: float, maximum: float
) -> float:
    """Returns a number within bounds, or the default. Raises `BridgeError` otherwise."""
    value: Any = operation.get(key)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BridgeError(f"{operation['op']}: '{key}' must be a number")
    if math.isnan(value) or not minimum <= value <= maximum:
        raise BridgeError(f"{operation['op']}: '{key}' must be {minimum:g} to {maximum:g}")
    return float(value)


def read_choice(operation: Operation, key: str, choices: tuple[str, ...]) -> str:
    """Returns one of some words, the first if missing. Raises `BridgeError` otherwise."""
    value = operation.get(key)
    if value is None or value == "":
        return choices[0]
    if value not in choices:
        raise BridgeError(f"{operation['op']}: '{key}' must be one of {', '.join(choices)}")
    return str(value)


def read_qos(operation: Operation) -> QoSProfile | None:
    """Returns the quality of service in the form of newer rosbridges, or None.

    Reads the first three of `{"depth", "reliability", "durability", "history", "lifespan"}`. Raises
    `BridgeError` for invalid values.
    """
    given = operation.get("qos")
    if given is None:
        return None
    if not isinstance(given, dict):
        raise BridgeError(f"{operation['op']}: 'qos' must be an object")
    chosen = {key: value for key, value in given.items() if value != "system_default"}
    fields: Operation = {**chosen, "op": f"{operation['op']}: qos"}
    reliability = read_choice(fields, "reliability", tuple(ReliabilityPolicy))
    durability = read_choice(fields, "durability", tuple(DurabilityPolicy))
    return QoSProfile(
        int(read_number(fields, "depth", DEFAULT_DEPTH, 1, MAX_DEPTH)),
        ReliabilityPolicy(reliability),
        DurabilityPolicy(durability),
    )


def absolute(name: str) -> str:
    """Returns the name in the graph of a client's `chatter` or `/chatter`."""
    return name if name.startswith("/") else f"/{name}"


def with_id(operation: Operation, name: Id) -> Operation:
    """Returns the operation, with the id if there is one."""
    if name is not None:
        operation["id"] = name
    return operation
