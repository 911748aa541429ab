"""What is wrong with a value, in the words of a scenario file instead of those of pydantic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.core.near_names import near_miss

_TABLE, _LIST = "a table is needed", "a list is needed, in brackets"
_NUMBER, _WHOLE_NUMBER = "a number is needed", "a whole number is needed"
_TEXT, _TRUTH = "a text is needed, in quotes", "true or false is needed"
_TEXTS = {
    "bool_parsing": _TRUTH,
    "bool_type": _TRUTH,
    "dict_type": _TABLE,
    "finite_number": "a finite number is needed",
    "float_parsing": _NUMBER,
    "float_type": _NUMBER,
    "greater_than": "a number above {gt} is needed",
    "greater_than_equal": "a number of at least {ge} is needed",
    "int_from_float": _WHOLE_NUMBER,
    "int_parsing": _WHOLE_NUMBER,
    "int_type": _WHOLE_NUMBER,
    "less_than": "a number below {lt} is needed",
    "less_than_equal": "a number of at most {le} is needed",
    "list_type": _LIST,
    "literal_error": "{expected} is needed",
    "mapping_type": _TABLE,
    "model_attributes_type": _TABLE,
    "model_type": _TABLE,
    "string_too_long": "at most {max_length} characters are allowed",
    "string_too_short": "at least {min_length} characters are needed",
    "string_type": _TEXT,
    "too_long": "a list of at most {max_length} is needed, not of {actual_length}",
    "too_short": "a list of at least {min_length} is needed, not of {actual_length}",
    "tuple_type": _LIST,
}
"""By the type of pydantic's error, with the values of its context."""
_PATTERNS = {
    "^[a-z][a-z0-9_]*$": "a name of small letters, digits and _ is needed, a letter first",
    "^[a-z0-9_]+$": "a name of small letters, digits and _ is needed",
    "^[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*$": "a topic of small letters, digits, _ and / is needed",
    r"^\w+/msg/\w+$": "a type such as std_msgs/msg/String is needed",
    r"^(\w[\w-]*|[\w.]+:\w+)$": "the name of a node, or module:Class, is needed",
    r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$": "a function is needed, as module:function",
    r"^/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*$": "a topic of letters, digits, _ and / is needed",
    r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$": "a topic or service is needed",
    r"^(/[A-Za-z_][A-Za-z0-9_]*)*$": "a namespace such as /uav1 is needed",
    r"^\w+(\.\w+)*$": "the path of a field, such as pose.position.z, is needed",
    r"^[A-Za-z0-9][A-Za-z0-9_.-]*$": "a name of letters, digits, _, - and . is needed",
    r"^[A-Za-z_]\w*$": "the name of a class is needed",
    r"^/[\w*?/]+$": "an absolute topic or service is needed; * and ? stand for others",
    r"^uav[1-9]\d*$": "the name of a UAV, such as uav2, is needed",
}
"""By the pattern that a text does not match."""


def fault_text(fault: Mapping[str, Any]) -> str:
    """Returns what an error of pydantic's `ValidationError.errors()` says about its value."""
    context = fault.get("ctx", {})
    if fault["type"] == "string_pattern_mismatch" and context["pattern"] in _PATTERNS:
        return _PATTERNS[context["pattern"]]
    if fault["type"] == "union_tag_invalid":
        allowed = [each.strip(" '") for each in context["expected_tags"].split(",")]
        hint = near_miss(context["tag"], allowed)
        return f"no '{context['tag']}'{hint} Allowed: {', '.join(allowed)}"
    text = _TEXTS.get(fault["type"])
    if text is None:
        return str(fault["msg"]).removeprefix("Value error, ")
    return text.format_map({key: _plain(value) for key, value in context.items()})


def _plain(value: Any) -> Any:
    return f"{value:.12g}" if isinstance(value, float) else value
