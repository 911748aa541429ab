"""Writes plain values as YAML, as `ros2 topic echo` does, but lists of numbers in one line."""

from __future__ import annotations

import io
import re
import sys
from functools import cache
from typing import Any

from numpy.typing import NDArray
from ruamel.yaml import YAML
from ruamel.yaml.emitter import Emitter
from ruamel.yaml.nodes import ScalarNode, SequenceNode
from ruamel.yaml.representer import SafeRepresenter

_DIRECTIVE = "%YAML 1.1\n---\n"
"""ROS tools read YAML 1.1, in which a bare `no` is false and a bare `1e-05` is a string."""
_VERBATIM = "!verbatim"
"""Tag of scalars whose text is YAML already."""
_EXPONENT_WITHOUT_POINT = re.compile(r"(?<![.\d])(\d+)e")


class Numbers:
    """Array of numbers, shape (n,); its text shows the first `max_length`."""

    def __init__(self, values: NDArray[Any], max_length: int) -> None:
        text = ", ".join(map(repr, values[:max_length].tolist()))
        text = _EXPONENT_WITHOUT_POINT.sub(r"\1.0e", text)
        text = text.replace("inf", ".inf").replace("nan", ".nan")
        left_out = len(values) - max_length
        self.text = f"[{text}, ... {left_out} more]" if left_out > 0 else f"[{text}]"


def write_yaml(fields: dict[str, Any]) -> str:
    """Returns dicts of dicts, lists, scalars and `Numbers` as YAML; "" for an empty dict."""
    if not fields:
        return ""
    text = io.StringIO()
    _yaml().dump(fields, text)
    return text.getvalue().removeprefix(_DIRECTIVE).removesuffix("\n")


@cache
def _yaml() -> Any:
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.Representer, yaml.Emitter = _Representer, _Emitter
    yaml.version = (1, 1)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = sys.maxsize
    return yaml


class _Representer(SafeRepresenter):
    """Represents messages as blocks, their lists of scalars in one line, without aliases."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def represent_list(self, data: list[Any]) -> SequenceNode:
        flow = not any(isinstance(item, dict) for item in data)
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flow)

    def represent_numbers(self, data: Numbers) -> ScalarNode:
        return ScalarNode(_VERBATIM, data.text)  # a node for each number would take long

    def represent_key(self, data: str) -> ScalarNode:
        return ScalarNode(_VERBATIM, data)  # names of fields: YAML 1.1 would quote `y`


_Representer.add_representer(list, _Representer.represent_list)
_Representer.add_representer(Numbers, _Representer.represent_numbers)


class _Emitter(Emitter):
    """Emits verbatim scalars as they are."""

    def process_tag(self) -> None:
        if str(self.event.tag) != _VERBATIM:
            super().process_tag()

    def process_scalar(self) -> None:
        if str(self.event.tag) != _VERBATIM:
            super().process_scalar()
            return
        self.write_indicator(self.event.value, need_whitespace=True)
        self.analysis = self.style = None
