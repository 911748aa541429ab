"""Messages as YAML, as ROS users read and type them."""

from __future__ import annotations

import io
import sys
from typing import Any

from volery.core.errors import GraphError

_LONGEST_LIST = 128


def to_yaml(message: Any, *, whole: bool = False) -> str:
    """A message as YAML; long lists of numbers are cut unless `whole`."""
    from volery.cli.yaml_writer import Numbers, write_yaml
    from volery.graph.codecs.json_codec import JsonCodec

    most = sys.maxsize if whole else _LONGEST_LIST
    form = JsonCodec(non_finite_as_null=False, arrays=lambda values, _kind: Numbers(values, most))
    return write_yaml(form.encode(message, message.__msgtype__))


def read_message(text: str, msgtype: str) -> Any:
    """The message that a user typed as YAML; what is missing is 0. `GraphError` for a wrong one."""
    from volery.graph.codecs.json_decoding import decode_plain

    return decode_plain(from_yaml(text) or {}, msgtype)


def from_yaml(text: str) -> Any:
    """Plain form of what a user typed. `GraphError` where it is no YAML."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(io.StringIO(text))
    except YAMLError as error:
        reason = " ".join(str(error).split())
        raise GraphError(f"'{text}' is no YAML: {reason}") from None
