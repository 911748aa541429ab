"""Generates TypeScript message types from the message definitions.

    python tools/typescript_messages.py > web/src/messages/generated.ts

Interfaces are named `package_Type`, with `_Request` and `_Response` for services. 64-bit integers
are `number` or, beyond 2^53, `bigint`; arrays of numbers are typed arrays where the transport
supports them (CBOR), else plain arrays; bytes are `Uint8Array`, or base64 in JSON.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import Any

from rosbags.interfaces import Nodetype

from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.typestore import typestore

_HEAD = """\
// Written by `python tools/typescript_messages.py` from the definitions of the messages.
// A test of the project fails when this file is older than they are.
"""
_ARRAYS = {
    "float32": "Float32Array",
    "float64": "Float64Array",
    "int8": "Int8Array",
    "int16": "Int16Array",
    "uint16": "Uint16Array",
    "int32": "Int32Array",
    "uint32": "Uint32Array",
}
_BYTES = {"uint8", "byte", "octet", "char"}
_LONG = {"int64", "uint64"}
_TEXT = {"string", "wstring"}
_PACKAGES = frozenset(
    {
        "builtin_interfaces",
        "diagnostic_msgs",
        "geometry_msgs",
        "mavros_msgs",
        "nav_msgs",
        "octomap_msgs",
        "rosapi_msgs",
        "rosgraph_msgs",
        "sensor_msgs",
        "simulation_interfaces",
        "std_msgs",
        "std_srvs",
        "tf2_msgs",
        "trajectory_msgs",
        "unique_identifier_msgs",
        "visualization_msgs",
        "volery_interfaces",
    }
)
"""Packages that the page uses; it reads other types by their rosapi descriptions."""


def declarations() -> str:
    """Returns the text of the generated file."""
    store = typestore()
    names = [name for name in store.names() if name.split("/")[0] in _PACKAGES]
    lines = [_HEAD]
    for name in names:
        lines += _interface(name, *store.fielddefs[name])
    lines += _dictionary("Messages", ((name, _named(name)) for name in names if "/msg/" in name))
    lines += _dictionary("Services", _services(names))
    return "\n".join(lines)


def _interface(name: str, constants: Iterable[Any], fields: Iterable[Any]) -> list[str]:
    inside = [
        f"  {field}: {_type(described)};" for field, described in fields if field != EMPTY_MEMBER
    ]
    if inside:
        lines = [f"export interface {_named(name)} {{", *inside, "}", ""]
    else:
        lines = [f"export type {_named(name)} = Record<string, never>;", ""]
    numbers = [f"  {key}: {_literal(value)}," for key, _, value in constants]
    if numbers:
        lines += [f"export const {_named(name)}_ = {{", *numbers, "} as const;", ""]
    return lines


def _dictionary(title: str, entries: Iterable[tuple[str, str]]) -> list[str]:
    inside = [f'  "{name}": {what};' for name, what in entries]
    return [f"export interface {title} {{", *inside, "}", ""]


def _services(names: Iterable[str]) -> Iterator[tuple[str, str]]:
    for name in names:
        if "/srv/" in name and name.endswith("_Request"):
            service = name.removesuffix("_Request")
            answer = _named(f"{service}_Response")
            yield service, f"{{ request: {_named(name)}; response: {answer} }}"


def _named(name: str) -> str:
    package, _, kind = name.split("/")
    return f"{package}_{kind}"


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _type(described: Any) -> str:
    kind, detail = described
    if kind == Nodetype.NAME:
        return _named(detail)
    if kind == Nodetype.BASE:
        return _scalar(detail[0])
    inner_kind, inner = detail[0]
    if inner_kind == Nodetype.BASE:
        base = inner[0]
        if base in _BYTES:
            return "Uint8Array | string"
        if base in _ARRAYS:
            return f"{_ARRAYS[base]} | number[]"
        if base in _LONG:
            return "(number | bigint)[]"
    return f"{_type(detail[0])}[]"


def _scalar(base: str) -> str:
    if base in _TEXT:
        return "string"
    if base == "bool":
        return "boolean"
    return "number | bigint" if base in _LONG else "number"


if __name__ == "__main__":
    sys.stdout.write(declarations())
