"""Reading the fields of a rosbridge operation."""

from __future__ import annotations

import math
from typing import Any

from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError
from volery.graph.qos import (
    DEFAULT_DEPTH,
    MOST_DEPTH,
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

Id = str | int | float | None
"""What a client may name an operation by; it is echoed as it came."""

MOST_NAME = 1000
"""Characters of a name or an id."""


def read_text(operation: Operation, key: str) -> str:
    """Text that must be there. `BridgeError` otherwise."""
    value = operation.get(key)
    if not isinstance(value, str) or not value:
        raise BridgeError(f"{operation['op']}: '{key}' must be text and not empty")
    if len(value) > MOST_NAME:
        raise BridgeError(f"{operation['op']}: '{key}' has more than {MOST_NAME} characters")
    return value


def read_optional_text(operation: Operation, key: str) -> str | None:
    """Text that may be missing, null or empty: None then. `BridgeError` for anything else."""
    if operation.get(key) in (None, ""):
        return None
    return read_text(operation, key)


def read_id(operation: Operation) -> Id:
    """The operation's id. `BridgeError` where it is neither text nor number."""
    value = operation.get("id")
    if value is None or (isinstance(value, str) and len(value) <= MOST_NAME):
        return value
    if isinstance(value, (int, float)) and abs(value) < 2**63:
        return value
    raise BridgeError(f"{operation['op']}: 'id' must be text or a number")


def read_number(
    operation: Operation, key: str, default: float, least: float, greatest: float
) -> float:
    """A number within bounds, or the default. `BridgeError` otherwise."""
    value: Any = operation.get(key)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BridgeError(f"{operation['op']}: '{key}' must be a number")
    if math.isnan(value) or not least <= value <= greatest:
        raise BridgeError(f"{operation['op']}: '{key}' must be {least:g} to {greatest:g}")
    return float(value)


def read_choice(operation: Operation, key: str, choices: tuple[str, ...]) -> str:
    """One of some words, the first if it is missing. `BridgeError` otherwise."""
    value = operation.get(key)
    if value is None or value == "":
        return choices[0]
    if value not in choices:
        raise BridgeError(f"{operation['op']}: '{key}' must be one of {', '.join(choices)}")
    return str(value)


def read_qos(operation: Operation) -> QoSProfile | None:
    """Quality of service as newer rosbridges take it, or None. `BridgeError` for what cannot be.

    Of `{"depth", "reliability", "durability", "history", "lifespan"}` the first three count here.
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
        int(read_number(fields, "depth", DEFAULT_DEPTH, 1, MOST_DEPTH)),
        ReliabilityPolicy(reliability),
        DurabilityPolicy(durability),
    )


def absolute(name: str) -> str:
    """Name in the graph of what a client calls `chatter` or `/chatter`."""
    return name if name.startswith("/") else f"/{name}"


def with_id(operation: Operation, name: Id) -> Operation:
    """The operation, named if there is a name."""
    if name is not None:
        operation["id"] = name
    return operation
