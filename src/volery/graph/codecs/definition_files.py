"""Reads message, service and action definitions from `.msg`, `.srv` and `.action` files.

A folder holds packages, each with its files in `msg/`, `srv/` and `action/`, as in ROS; files
outside such a folder belong to the package named after their own folder. Definitions of both ROS
generations are supported: `time`, `duration` and `Header` of ROS 1, limits and default values of
ROS 2.
"""

from __future__ import annotations

import ast
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.core.plurals import counted

INTEGER_RANGES = {
    "byte": (-(2**7), 2**8 - 1),  # octet in ROS 2, a signed number in ROS 1
    "char": (0, 2**8 - 1),
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""Minimum and maximum of each integer type."""
NUMBERS = {"bool", "float32", "float64", *INTEGER_RANGES}

_ROS1_BUILTIN = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
    "Header": "std_msgs/msg/Header",
}
_ACTION_NESTED = {
    "goal_id": "unique_identifier_msgs/msg/UUID",
    "stamp": "builtin_interfaces/msg/Time",
}
_PACKAGE = re.compile(r"[A-Za-z]\w*", re.ASCII)
_TYPE_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_FILE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
"""Name of a type, as in ROS 2: CamelCase."""
_LINE = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=(?P<limit>\d+))?"
    r"(?P<array>\[(?:(?P<size>\d+)|<=(?P<bound>\d+))?\])?"
    r"\s+(?P<name>[A-Za-z]\w*)"
    r"(?:\s*=\s*(?P<constant>.*)|\s+(?P<default>[^\s=].*))?",
    re.ASCII,
)
# Fixed arrays are allocated for every message, so a typing error must not cost gigabytes.
_MAX_NUMBERS = 1 << 24
_MAX_PARTS = 4096
MAX_FIELDS = 4096
"""Limit of the fields and constants of one type."""

_KINDS = {".msg": "msg", ".srv": "srv", ".action": "action"}
_PARTS = {
    "msg": ("",),
    "srv": ("_Request", "_Response"),
    "action": (
        "_Goal",
        "_Result",
        "_Feedback",
        "_SendGoal_Request",
        "_SendGoal_Response",
        "_GetResult_Request",
        "_GetResult_Response",
        "_FeedbackMessage",
    ),
}
_SECTIONS = {"msg": 1, "srv": 2, "action": 3}


@dataclass
class Definition:
    """One message type, or one part of a service or an action."""

    name: str
    """ROS 2 name, such as `std_srvs/srv/Trigger_Response`."""
    source: str
    """The definition's file, for error messages."""
    fields: list[tuple[str, Any]] = field(default_factory=list)
    """Names and types; types as `rosbags` describes them."""
    constants: list[tuple[str, Any, Any]] = field(default_factory=list)
    """Name, type and value."""
    constant_texts: dict[str, str] = field(default_factory=dict)
    """Values as written: ROS 1 computes its md5 sums from the text."""
    defaults: dict[str, Any] = field(default_factory=dict)
    """Default values of fields, where not zero."""
    nested: list[tuple[str, int]] = field(default_factory=list)
    """Nested types, each with its line."""


@dataclass(frozen=True)
class DefinitionFile:
    """A definition file that has not been read yet."""

    path: Path
    package: str
    kind: str
    """`msg`, `srv` or `action`."""

    @property
    def base(self) -> str:
        """Name of the interface: `std_srvs/srv/Trigger`."""
        return f"{self.package}/{self.kind}/{self.path.stem}"

    @property
    def names(self) -> list[str]:
        """Names of the types in the file."""
        return [f"{self.base}{part}" for part in _PARTS[self.kind]]


def find_definition_files(folder: Path, *, foreign: bool = False) -> list[DefinitionFile]:
    """Returns all definition files below a folder, sorted by path.

    foreign: the files come from a log, whose types may have any name that ROS 1 allows.

    Raises `GraphError` if the folder does not exist, contains no definition, or a file or package
    has an invalid ROS name.
    """
    if not folder.is_dir():
        raise GraphError(f"{folder}: this folder of message definitions does not exist")
    found = []
    for where, inner, names in os.walk(folder):
        inner.sort()
        parent = Path(where)
        in_kind = parent.name in _PARTS and parent != folder
        package = (parent.parent if in_kind else parent).resolve().name
        for name in sorted(names):
            stem, suffix = os.path.splitext(name)
            kind = _KINDS.get(suffix)
            if kind is None:
                continue
            path = parent / name
            if in_kind and parent.name != kind:
                raise GraphError(f"{path}: a {suffix} file belongs in a folder {kind}/")
            if not (_TYPE_NAME if foreign else _FILE_NAME).fullmatch(stem):
                raise GraphError(
                    f"{path}: '{stem}' is not a valid name of a ROS type: use CamelCase, "
                    "a capital followed by letters and digits"
                )
            if not _PACKAGE.fullmatch(package):
                raise GraphError(f"{path}: '{package}' is not a valid name of a ROS package")
            found.append(DefinitionFile(path, package, kind))
    if not found:
        raise GraphError(f"{folder}: contains no .msg, .srv or .action file")
    return found


def read_definition_file(file: DefinitionFile) -> list[Definition]:
    """Returns the types of a file.

    Raises `GraphError` if the file cannot be read or does not follow the format; the message names
    file and line.
    """
    try:
        text = file.path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise GraphError(f"{file.path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise GraphError(f"{file.path}: is not UTF-8 text") from None
    return parse_definition(text, file.base, str(file.path))


def parse_definition(text: str, name: str, source: str) -> list[Definition]:
    """Returns the types that a text defines.

    Parameters: `text` is the content of a definition file, `name` is `package/msg/Name`,
    `package/srv/Name` or `package/action/Name`, `source` names the text in errors, usually its
    path. Raises `GraphError` as `read_definition_file` does.
    """
    package, kind, _ = name.split("/")
    parts = [Definition(f"{name}{part}", source) for part in _PARTS[kind]]
    section = 0
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if stripped == "---" and _SECTIONS[kind] > 1:
            section += 1
            if section == _SECTIONS[kind]:
                raise GraphError(f"{source}:{number}: {_dashes(kind)}; this line is one too many")
        elif stripped and not stripped.startswith("#"):
            try:
                _read_line(parts[section], stripped, package, number)
            except ValueError as error:
                raise GraphError(f"{source}:{number}: {error}") from None
    if section != _SECTIONS[kind] - 1:
        raise GraphError(f"{source}: {_dashes(kind)}, found {section}")
    if kind == "action":
        _complete_action(parts, name)
    return parts


def _dashes(kind: str) -> str:
    count = _SECTIONS[kind] - 1
    return f"a .{kind} file has {counted(count, 'line')} '---'"


def _complete_action(parts: list[Definition], name: str) -> None:
    """Adds the fields of the messages that implement an action in ROS 2."""

    def fill(definition: Definition, **fields: str) -> None:
        for field_name, typename in fields.items():
            if typename in NUMBERS:
                definition.fields.append((field_name, (Nodetype.BASE, (typename, 0))))
            else:
                definition.fields.append((field_name, (Nodetype.NAME, typename)))
                definition.nested.append((typename, 1))

    _, _, _, send, sent, get, got, feedback = parts
    goal_id = _ACTION_NESTED["goal_id"]
    fill(send, goal_id=goal_id, goal=f"{name}_Goal")
    fill(sent, accepted="bool", stamp=_ACTION_NESTED["stamp"])
    fill(get, goal_id=goal_id)
    fill(got, status="int8", result=f"{name}_Result")
    fill(feedback, goal_id=goal_id, feedback=f"{name}_Feedback")


def _read_line(definition: Definition, line: str, package: str, number: int) -> None:
    """Adds one field or constant; raises ValueError with the line's problem."""
    # A string constant of ROS 1 extends to the end of its line, '#' included.
    text_constant = re.match(r"string(<=\d+)?\s+\w+\s*=", line)
    if not text_constant:
        line = _without_comment(line)
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError(f"cannot read '{line}'; expected 'type name' or 'type NAME=value'")
    name = match["name"]
    if len(definition.fields) + len(definition.constants) >= MAX_FIELDS:
        raise ValueError(f"a type has at most {MAX_FIELDS} fields and constants")
    taken = {n for n, _ in definition.fields} | {n for n, _, _ in definition.constants}
    if name in taken:
        raise ValueError(f"'{name}' is defined twice")
    described = _describe(match, package)
    if match["constant"] is not None:
        base = match["type"]
        if match["array"] or described[0] != Nodetype.BASE:
            raise ValueError(f"constant '{name}' must be a number, a bool or a string")
        text = match["constant"].strip()
        value = _text_value(text) if base == "string" else _number_value(text, base)
        definition.constants.append((name, base, value))
        definition.constant_texts[name] = text
        return
    element = described[1][0] if match["array"] else described
    if element[0] == Nodetype.NAME:
        definition.nested.append((element[1], number))
    definition.fields.append((name, described))
    if match["default"] is not None:
        definition.defaults[name] = _default(match["default"], described)


def _without_comment(line: str) -> str:
    """Returns the line without its comment; a '#' in quotes starts none."""
    quote = ""
    for index, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter == "#":
            return line[:index].rstrip()
    return line


def _describe(match: re.Match[str], package: str) -> Any:
    """Returns the type of a field as `rosbags` describes it."""
    base = match["type"]
    element: Any
    if base in NUMBERS or base == "string":
        if match["limit"] and base != "string":
            raise ValueError(f"only a string may have a length limit, not {base}")
        element = (Nodetype.BASE, (base, int(match["limit"] or 0)))
    elif base in ("wstring", "wchar", "float128", "long double"):
        raise ValueError(f"{base} is not supported")
    else:
        if match["limit"]:
            raise ValueError(f"only a string may have a length limit, not {base}")
        element = (Nodetype.NAME, _nested_name(base, package))
    if match["array"] is None:
        return element
    size = int(match["size"] or match["bound"] or 0)
    if match["size"] is not None:
        limit = _MAX_NUMBERS if base in NUMBERS else _MAX_PARTS
        if not 1 <= size <= limit:
            raise ValueError(f"a fixed array of {base} must have 1 to {limit} elements, not {size}")
        return (Nodetype.ARRAY, (element, size))
    if match["bound"] is not None and size < 1:
        raise ValueError("a bounded array must allow at least 1 element")
    return (Nodetype.SEQUENCE, (element, size))


def _nested_name(written: str, package: str) -> str:
    if written in _ROS1_BUILTIN:
        return _ROS1_BUILTIN[written]
    parts = written.split("/")
    if len(parts) == 1:
        parts = [package, *parts]
    if len(parts) == 2:
        parts = [parts[0], "msg", parts[1]]
    if len(parts) != 3 or not _PACKAGE.fullmatch(parts[0]) or not _TYPE_NAME.fullmatch(parts[2]):
        raise ValueError(f"'{written}' is not the name of a type")
    return "/".join(parts)


def _text_value(text: str) -> str:
    if len(text) >= 2 and text[0] in "\"'" and text[-1] == text[0]:
        return text[1:-1]
    return text


def _number_value(text: str, base: str) -> bool | int | float:
    """Returns the value of a literal for a field of type `base`."""
    if base == "bool":
        if text.lower() in ("true", "1", "false", "0"):
            return text.lower() in ("true", "1")
        raise ValueError(f"'{text}' is not a bool")
    try:
        value = float(text) if base.startswith("float") else _integer(text)
    except ValueError:
        raise ValueError(f"'{text}' is not a {base}") from None
    if base in INTEGER_RANGES:
        minimum, maximum = INTEGER_RANGES[base]
        if not minimum <= value <= maximum:
            raise ValueError(f"{text} does not fit {base} ({minimum} to {maximum})")
    return value


def _integer(text: str) -> int:
    # ROS 1 and ROS 2 both read 017 as seventeen; Python rejects it as a literal.
    return int(text) if text.lstrip("+-").isdigit() else int(text, 0)


def _default(text: str, described: Any) -> Any:
    """Returns the default value written after a field."""
    kind, detail = described
    text = text.strip()
    if kind == Nodetype.NAME:
        raise ValueError("a nested message cannot have a default value")
    if kind == Nodetype.BASE:
        return _text_value(text) if detail[0] == "string" else _number_value(text, detail[0])
    (inner, inner_detail), size = detail
    if inner == Nodetype.NAME:
        raise ValueError("an array of messages cannot have a default value")
    if not (text.startswith("[") and text.endswith("]")):
        raise ValueError(f"the default of an array must be a list, not '{text}'")
    base = inner_detail[0]
    if base == "string":
        try:
            values = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            raise ValueError(f"'{text}' is not a list of strings") from None
        if not all(isinstance(value, str) for value in values):
            raise ValueError(f"'{text}' is not a list of strings")
    else:
        items = [item.strip() for item in text[1:-1].split(",")]
        values = [_number_value(item, base) for item in items if item]
    if (kind == Nodetype.ARRAY and len(values) != size) or (size and len(values) > size):
        raise ValueError(f"the default has {counted(len(values), 'element')}, the array {size}")
    return values
