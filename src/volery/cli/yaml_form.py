"""Messages as YAML, as ROS users read and type them."""

from __future__ import annotations

import io
from typing import Any

from volery.core.errors import GraphError

_LONGEST_LIST = 128


def to_yaml(message: Any, *, whole: bool = False) -> str:
    """A message as YAML; long lists are cut unless `whole`."""
    from volery.graph.json_form import JsonForm

    form = JsonForm(non_finite_as_null=False, arrays=lambda values, _kind: values.tolist())
    plain = form.encode(message, message.__msgtype__)
    lines: list[str] = []
    _write(plain, 0, lines, whole=whole)
    return "\n".join(lines)


def read_message(text: str, msgtype: str) -> Any:
    """The message that a user typed as YAML; what is missing is 0. `GraphError` for a wrong one."""
    from volery.graph.json_decoding import decode_plain

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


def _write(value: Any, depth: int, lines: list[str], *, whole: bool) -> None:
    indent = "  " * depth
    for name, part in value.items():
        if isinstance(part, dict) and part:
            lines.append(f"{indent}{name}:")
            _write(part, depth + 1, lines, whole=whole)
        elif isinstance(part, list) and part and isinstance(part[0], dict):
            lines.append(f"{indent}{name}:")
            _write_items(part, depth, lines, whole=whole)
        else:
            lines.append(f"{indent}{name}: {_scalar(part, whole=whole)}")


def _write_items(items: list[Any], depth: int, lines: list[str], *, whole: bool) -> None:
    for item in items:
        inner: list[str] = []
        _write(item, depth + 1, inner, whole=whole)
        inner[0] = "  " * depth + "- " + inner[0].lstrip()
        lines += inner


def _scalar(value: Any, *, whole: bool) -> str:
    if isinstance(value, list):
        shown = value if whole or len(value) <= _LONGEST_LIST else value[:_LONGEST_LIST]
        more = f", ... {len(value) - len(shown)} more" if len(shown) < len(value) else ""
        return "[" + ", ".join(_scalar(v, whole=whole) for v in shown) + more + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, str):
        return _text(value)
    return repr(value)


def _text(value: str) -> str:
    """A string, quoted where YAML would read it as something else."""
    import json

    plain = value.replace("_", "").replace("/", "").isalnum() and not value[0].isdigit()
    words = {"true", "false", "null", "yes", "no", "on", "off", "inf", "nan", "y", "n"}
    return value if plain and value.lower() not in words else json.dumps(value, ensure_ascii=False)
