"""Fills the present time into plain messages, where clients leave it to the receiver."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.clock import stamp_from_ns
from volery.graph.typestore import typestore

_HEADER, _TIME = "std_msgs/msg/Header", "builtin_interfaces/msg/Time"


def with_present_times(
    plain: Any, msgtype: str, now_ns: Callable[[], int], *, stamps_headers: bool = False
) -> Any:
    """Returns plain values with `now_ns()` for a time `now` and a header `auto`, as in ROS 2.

    stamps_headers: headers without a stamp, or with an empty one, get one as well, as in rosbridge;
    the message's own also if it is omitted. Other times may be null or 0.
    """
    if stamps_headers and isinstance(plain, dict) and "header" not in plain:
        own = [member for member in _timed_members(msgtype) if member[0] == "header"]
        if own and own[0][1] == _HEADER:
            plain = {**plain, "header": {}}
    return _filled(plain, msgtype, cache(now_ns), stamps_headers)


def _filled(plain: Any, msgtype: str, now_ns: Callable[[], int], stamps_headers: bool) -> Any:
    if msgtype == _TIME:
        if stamps_headers and _is_no_time(plain):
            return {}
        return _stamp(now_ns) if plain == "now" else plain
    if msgtype == _HEADER:
        if plain == "auto":
            return {"stamp": _stamp(now_ns)}
        if stamps_headers and isinstance(plain, dict) and _is_no_time(plain.get("stamp")):
            return {**plain, "stamp": _stamp(now_ns)}
    members = _timed_members(msgtype)
    if not members or not isinstance(plain, dict):
        return plain
    filled = dict(plain)
    for name, inner, is_list in members:
        if name not in filled:
            continue
        value = filled[name]
        if not is_list:
            filled[name] = _filled(value, inner, now_ns, stamps_headers)
        elif isinstance(value, list):
            filled[name] = [_filled(part, inner, now_ns, stamps_headers) for part in value]
    return filled


def _is_no_time(plain: Any) -> bool:
    """Returns whether a client gives no time: nothing, null as roslibpy, 0, or an empty object."""
    return plain is None or plain == {} or (plain == 0 and not isinstance(plain, bool))


def _stamp(now_ns: Callable[[], int]) -> dict[str, int]:
    sec, nanosec = stamp_from_ns(now_ns())
    return {"sec": sec, "nanosec": nanosec}


def _timed_members(msgtype: str) -> tuple[tuple[str, str, bool], ...]:
    """Returns the members with times: their names, types and whether they are lists."""
    known = _members.get(msgtype)
    if known is not None:
        return known
    definition = typestore().fielddefs.get(msgtype)
    if definition is None:  # it may be defined later
        return ()
    found = []
    detail: Any
    for name, (kind, detail) in definition[1]:
        is_list = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        inner_kind, inner = detail[0] if is_list else (kind, detail)
        if inner_kind == Nodetype.NAME and (inner == _TIME or _timed_members(inner)):
            found.append((name, inner, is_list))
    return _members.setdefault(msgtype, tuple(found))


_members: dict[str, tuple[tuple[str, str, bool], ...]] = {}
