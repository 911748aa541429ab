"""Converts messages to and from YAML, in the form of the ROS tools."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError

_MAX_LIST_LENGTH = 128


def to_yaml(message: Any, *, whole: bool = False) -> str:
    """Returns a message as YAML; cuts long lists of numbers unless `whole`."""
    from volery.cli.yaml_writer import Numbers, write_yaml
    from volery.graph.codecs.json_codec import JsonCodec

    max_length = sys.maxsize if whole else _MAX_LIST_LENGTH
    form = JsonCodec(
        non_finite_as_null=False, arrays=lambda values, _kind: Numbers(values, max_length)
    )
    return write_yaml(form.encode(message, message.__msgtype__))


def read_message(text: str, msgtype: str, now_ns: Callable[[], int] = time.time_ns) -> Any:
    """Returns the message of a YAML text; missing fields are 0. Raises `GraphError` if invalid.

    As in ROS 2, `header: auto` and a time `now` mean the present time, `now_ns()`.
    """
    from volery.graph.codecs.json_decoding import decode_plain
    from volery.graph.codecs.present_times import with_present_times

    return decode_plain(with_present_times(from_yaml(text) or {}, msgtype, now_ns), msgtype)


def from_yaml(text: str) -> Any:
    """Returns the plain values of a YAML text. Raises `GraphError` if the text is no YAML."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(io.StringIO(text))
    except YAMLError as error:
        reason = " ".join(str(error).split())
        raise GraphError(f"'{text}' is not YAML: {reason}") from None
