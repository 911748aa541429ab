"""Calls some functions of Cyclone DDS's C library directly, without its Python package.

The package's own `write` holds Python's lock while it works. Called through ctypes, the same C
function runs without it, so that neither engine nor bridges wait for a network.
"""

from __future__ import annotations

import ctypes
from typing import Any

from cyclonedds.__library__ import library_path
from cyclonedds.core import Entity
from cyclonedds.topic import Sample

_library = ctypes.CDLL(str(library_path))
_entity, _result = ctypes.c_int32, ctypes.c_int32


def _function(name: str, *arguments: Any, result: Any = _result) -> Any:
    found = getattr(_library, name)
    found.argtypes = arguments
    found.restype = result
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
_free = _function("dds_free", ctypes.c_void_p, result=None)
_user_data = _function(
    "dds_qget_userdata",
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.c_void_p),
    ctypes.POINTER(ctypes.c_size_t),
    result=ctypes.c_bool,
)
_reliability = _function(
    "dds_qget_reliability",
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.c_int),
    ctypes.POINTER(ctypes.c_int64),
    result=ctypes.c_bool,
)
_durability = _function(
    "dds_qget_durability", ctypes.c_void_p, ctypes.POINTER(ctypes.c_int), result=ctypes.c_bool
)

_BEST_EFFORT, _VOLATILE = 0, 0
"""Values DDS_RELIABILITY_BEST_EFFORT, DDS_DURABILITY_VOLATILE."""
_MAX_RESULTS = 256
_ALIGNMENT = 4


def write(writer: Any, cdr: bytes) -> bool:
    """Writes a sample given as CDR; returns whether it was sent."""
    rest = -len(cdr) % _ALIGNMENT
    data = cdr + bytes(rest) if rest else cdr  # the C library sends whole words
    sample = Sample(ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p), len(data))
    return bool(_write(writer._ref, ctypes.byref(sample)) == 0)


def delete(entity: Any) -> None:
    """Deletes an entity and its children now, even if Python objects still refer to them."""
    Entity._entities.pop(entity._ref, None)  # else the object would delete it again
    _delete(entity._ref)


def attach(waitset: Any, condition: Any, number: int) -> None:
    """Makes `wait` return `number` while a condition is true."""
    _attach(waitset._ref, condition._ref, number)


def detach(waitset: Any, condition: Any) -> None:
    """Undoes `attach`."""
    _detach(waitset._ref, condition._ref)


def wait(waitset: Any, timeout_ns: int) -> list[int] | None:
    """Returns numbers of true conditions; empty after `timeout_ns`, None after deletion."""
    found = (ctypes.c_ssize_t * _MAX_RESULTS)()
    count = _wait(waitset._ref, found, _MAX_RESULTS, timeout_ns)
    return None if count < 0 else found[: min(count, _MAX_RESULTS)]


def subscriptions(writer: Any) -> int:
    """Returns the number of a writer's readers."""
    return max(int(_matched(writer._ref, None, 0)), 0)


def readers_of(writer: Any) -> list[int]:
    """Returns instance handles of a writer's readers, some hundreds at most.

    None after deletion.
    """
    found = (ctypes.c_uint64 * _MAX_RESULTS)()
    count = int(_matched(writer._ref, found, _MAX_RESULTS))
    return found[: min(max(count, 0), _MAX_RESULTS)]


def publications(reader: Any) -> int:
    """Returns the number of a reader's writers."""
    return max(int(_served(reader._ref, None, 0)), 0)


def user_data(qos: int) -> bytes:
    """Returns the user data in a `dds_qos_t`, by its address."""
    value, size = ctypes.c_void_p(), ctypes.c_size_t()
    if not _user_data(qos, ctypes.byref(value), ctypes.byref(size)) or not value:
        return b""
    try:
        return ctypes.string_at(value, size.value)
    finally:
        _free(value)


def is_reliable(qos: int) -> bool:
    """Returns whether a `dds_qos_t` is not best effort."""
    kind = ctypes.c_int()
    has_reliability = _reliability(qos, ctypes.byref(kind), ctypes.byref(ctypes.c_int64()))
    return not (has_reliability and kind.value == _BEST_EFFORT)


def is_latched(qos: int) -> bool:
    """Returns whether a `dds_qos_t` stores samples for late readers."""
    kind = ctypes.c_int()
    return bool(_durability(qos, ctypes.byref(kind))) and kind.value != _VOLATILE
