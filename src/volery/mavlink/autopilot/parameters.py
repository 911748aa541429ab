"""Parameters of the autopilot: all have an effect, with PX4's names and, if any, PX4's defaults.

`DEFAULTS` is the documented set, from `parameters.toml`; docs/mavlink.md lists it. Values are ints
(INT32) or floats (REAL32), sent as in PX4: the bytes of an int in the place of a float's.
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import NamedTuple

from volery.core.data_tables import read_table

Value = int | float
UINT32, INT32, REAL32 = 5, 6, 9
"""Values of MAV_PARAM_TYPE."""


class AutopilotParameter(NamedTuple):
    """One parameter: default, allowed range, description. `fixed` ones cannot be set."""

    default: Value
    low: float
    high: float
    description: str
    fixed: bool = False


DEFAULTS = {
    name: AutopilotParameter(
        row["default"],
        low=row["range"][0],
        high=row["range"][1],
        description=row["description"],
        fixed=row.get("fixed", False),
    )
    for name, row in read_table(__file__, "parameters.toml").items()
}
NAMES = tuple(sorted(DEFAULTS))
CHECK = "_HASH_CHECK"
"""Name under which the check of all values is sent."""


def defaults() -> dict[str, Value]:
    """Returns all default values."""
    return {name: DEFAULTS[name].default for name in NAMES}


def type_of(name: str) -> int:
    """Returns the MAV_PARAM_TYPE of a parameter."""
    return INT32 if isinstance(DEFAULTS[name].default, int) else REAL32


def refusal(name: str, value: Value) -> str:
    """Returns why a parameter cannot be set to a value; empty if it can."""
    parameter = DEFAULTS.get(name)
    if parameter is None:
        return f"no parameter {name}"
    if parameter.fixed:
        return f"{name} cannot be set"
    if not (math.isfinite(value) and parameter.low <= value <= parameter.high):
        return f"{name}: {parameter.low:g} to {parameter.high:g}"
    return ""


def on_wire(name: str, value: Value) -> float:
    """Returns the float that carries a value."""
    if type_of(name) == INT32:
        packed: float = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        return packed
    return float(value)


def check_of(values: dict[str, Value]) -> int:
    """Returns the CRC-32 over names and values, with which stations check theirs.

    As in PX4's `param_hash_check`, the remainder begins with 0 and is not inverted.
    """
    packed = (struct.pack("<i" if type_of(name) == INT32 else "<f", values[name]) for name in NAMES)
    data = b"".join(
        part for pair in zip(map(str.encode, NAMES), packed, strict=True) for part in pair
    )
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def from_wire(kind: int, carried: float) -> Value | None:
    """Returns the value in a float of MAV_PARAM_TYPE `kind`; None for other types than PX4's."""
    if kind == INT32:
        value: int = struct.unpack("<i", struct.pack("<f", carried))[0]
        return value
    return float(carried) if kind == REAL32 else None
