"""Converts messages to and from YAML, in the form of the ROS tools."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any

from volery.core.errors import GraphError

_LONGEST_LIST = 128


def to_yaml(message: Any, *, whole: bool = False) -> str:
    """Returns a message as YAML; cuts long lists of numbers unless `whole`."""
    from volery.cli.yaml_writer import Numbers, write_yaml
    from volery.graph.codecs.json_codec import JsonCodec

    most = sys.maxsize if whole else _LONGEST_LIST
    form = JsonCodec(non_finite_as_null=False, arrays=lambda values, _kind: Numbers(values, most))
    return write_yaml(form.encode(message, message.__msgtype__))


def read_message(text: str, msgtype: str, now_ns: Callable[[], int] = time.time_ns) -> Any:
    """Returns the message of a YAML text; missing fields are 0. Raises `GraphError` if invalid.

    As in ROS 2, `header: auto` and a time `now` mean the present time, `now_ns()`.
    """
    from volery.graph.codecs.json_decoding import decode_plain
    from volery.graph.typestore import typestore

    plain = from_yaml(text) or {}
    if msgtype in typestore().fielddefs:
        plain = _with_times(plain, msgtype, cache(now_ns))
    return decode_plain(plain, msgtype)


def _with_times(plain: Any, msgtype: str, now_ns: Callable[[], int]) -> Any:
    """Returns plain values with `auto` and `now` replaced where the type has headers and times."""
    from rosbags.interfaces import Nodetype

    from volery.core.clock import stamp_from_ns
    from volery.graph.typestore import typestore

    def now() -> dict[str, int]:
        sec, nanosec = stamp_from_ns(now_ns())
        return {"sec": sec, "nanosec": nanosec}

    if msgtype == "std_msgs/msg/Header" and plain == "auto":
        return {"stamp": now()}
    if msgtype == "builtin_interfaces/msg/Time" and plain == "now":
        return now()
    if not isinstance(plain, dict):
        return plain
    filled = dict(plain)
    detail: Any
    for name, (kind, detail) in typestore().fielddefs[msgtype][1]:
        if name not in filled:
            continue
        if kind == Nodetype.NAME:
            filled[name] = _with_times(filled[name], detail, now_ns)
        elif kind != Nodetype.BASE and detail[0][0] == Nodetype.NAME:
            parts, inner = filled[name], detail[0][1]
            if isinstance(parts, list):
                filled[name] = [_with_times(part, inner, now_ns) for part in parts]
    return filled


def from_yaml(text: str) -> Any:
    """Returns the plain values of a YAML text. Raises `GraphError` if the text is no YAML."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(io.StringIO(text))
    except YAMLError as error:
        reason = " ".join(str(error).split())
        raise GraphError(f"'{text}' is not YAML: {reason}") from None
