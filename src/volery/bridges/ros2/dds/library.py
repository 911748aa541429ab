"""The few functions of Cyclone DDS's C library that are called past its Python package.

The package's own `write` holds Python's lock while it works. Called through ctypes, the same C
function runs without it, so that neither engine nor doors wait for a network.
"""

from __future__ import annotations

import ctypes
from typing import Any

from cyclonedds.__library__ import library_path
from cyclonedds.core import Entity
from cyclonedds.topic import Sample

_library = ctypes.CDLL(str(library_path))
_entity, _result = ctypes.c_int32, ctypes.c_int32


def _function(name: str, *arguments: Any) -> Any:
    found = getattr(_library, name)
    found.argtypes = arguments
    found.restype = _result
    return found


_write = _function("dds_write", _entity, ctypes.c_void_p)
_delete = _function("dds_delete", _entity)
_attach = _function("dds_waitset_attach", _entity, _entity, ctypes.c_ssize_t)
_detach = _function("dds_waitset_detach", _entity, _entity)
_wait = _function(
    "dds_waitset_wait",
    _entity,
    ctypes.POINTER(ctypes.c_ssize_t),
    ctypes.c_size_t,
    ctypes.c_int64,
)
_matched = _function(
    "dds_get_matched_subscriptions",
    _entity,
    ctypes.POINTER(ctypes.c_uint64),
    ctypes.c_size_t,
)
_served = _function(
    "dds_get_matched_publications",
    _entity,
    ctypes.POINTER(ctypes.c_uint64),
    ctypes.c_size_t,
)

_MOST_AT_ONCE = 256
_ALIGNMENT = 4


def write(writer: Any, cdr: bytes) -> bool:
    """Write a sample given as CDR; whether it went out."""
    rest = -len(cdr) % _ALIGNMENT
    data = cdr + bytes(rest) if rest else cdr  # the C side sends whole words
    sample = Sample(ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p), len(data))
    return bool(_write(writer._ref, ctypes.byref(sample)) == 0)


def delete(entity: Any) -> None:
    """End an entity and those below it now, whoever still refers to them in Python."""
    Entity._entities.pop(entity._ref, None)  # else it would be deleted again with the object
    _delete(entity._ref)


def attach(waitset: Any, condition: Any, number: int) -> None:
    """Have `wait` return `number` while a condition is true."""
    _attach(waitset._ref, condition._ref, number)


def detach(waitset: Any, condition: Any) -> None:
    """Undo `attach`."""
    _detach(waitset._ref, condition._ref)


def wait(waitset: Any, timeout_ns: int) -> list[int] | None:
    """Numbers of conditions that are true; empty after `timeout_ns`, None once it is deleted."""
    found = (ctypes.c_ssize_t * _MOST_AT_ONCE)()
    count = _wait(waitset._ref, found, _MOST_AT_ONCE, timeout_ns)
    return None if count < 0 else found[: min(count, _MOST_AT_ONCE)]


def subscriptions(writer: Any) -> int:
    """How many readers a writer has."""
    return max(int(_matched(writer._ref, None, 0)), 0)


def publications(reader: Any) -> int:
    """How many writers a reader has."""
    return max(int(_served(reader._ref, None, 0)), 0)
