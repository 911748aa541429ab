"""Types as a log defines them, where the local definition of the same name is another.

Definitions change between versions of packages. Such a type is registered under a package name of
its own, `mavros_msgs_1a2b3c4d/msg/State`, and decodes the log's bytes. If all of its fields are
also fields of the local type, messages become local ones, whose other fields have their defaults.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype

from volery.bridges.logs.budgets import MAX_DEFINITION_BYTES, MAX_NESTED_TYPES
from volery.bridges.logs.idl_definitions import msg_texts
from volery.bridges.logs.records import LogTopic
from volery.core.errors import GraphError
from volery.graph.codecs.definition_files import Definition, parse_definition
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import add_definitions
from volery.graph.typestore import typestore

_MD5_OF_NOTHING = "d41d8cd98f00b204e9800998ecf8427e"
_SEPARATOR = re.compile(r"^=+\s*$", re.MULTILINE)
_NESTED = re.compile(r"\s*MSG:\s*(\S+)[^\n]*\n?")
_TYPE = re.compile(r"([A-Za-z]\w{0,99})/(?:(msg|srv|action)/)?([A-Za-z]\w{0,99})", re.ASCII)
_DEFINITION_FORMATS = ("ros1msg", "ros2msg", "ros2idl")
_DASHES = re.compile(r"^---\s*$", re.MULTILINE)
_HEADER = re.compile(r"^(\s*)Header\b", re.MULTILINE)
_FIELD_TYPE = re.compile(r"^(\s*)([A-Za-z][\w/]*)", re.ASCII)


class LearnedType(NamedTuple):
    """The type that decodes a topic's bytes."""

    name: str
    problem: str
    """Why it is not from the log's definition; empty if it is."""


def learn_type(name: str, topic: LogTopic) -> LearnedType:
    """Returns the type that decodes a topic; registers what the log defines.

    name: the topic's type in ROS 2 style. Raises `GraphError` if the log does not define an
    unknown type, or its definition is invalid.
    """
    is_ros1 = topic.encoding == "ros1"
    form = topic.schema_encoding
    if not topic.definition.strip() and not (is_ros1 and topic.digest == _MD5_OF_NOTHING):
        form = ""  # recorders write nothing, too, if they lack the definition
    return _learned(name, topic.definition, form, is_ros1)


@lru_cache(256)
def _learned(name: str, definition: str, form: str, is_ros1: bool) -> LearnedType:
    is_known = name in typestore().types
    try:
        texts = _texts(name, definition, form)
        renamed = _renamed(texts, is_ros1=is_ros1)
        _register(texts, renamed)
    except GraphError as error:
        if is_known:  # the local definition is the best that there is
            return LearnedType(name, str(error))
        raise
    return LearnedType(renamed.get(name, name), "")


def is_part_of(name: str, other: str) -> bool:
    """Returns whether all fields of a type are fields of another."""
    theirs = _shape(typestore().fielddefs[other][1])
    return _shape(typestore().fielddefs[name][1]).items() <= theirs.items()


def as_type(message: Any, msgtype: str) -> Any:
    """Returns a message of another type with the same fields, and defaults in all others."""
    values = {field.name: getattr(message, field.name) for field in fields(message)}
    values.pop(EMPTY_MEMBER, None)
    return typestore().types[msgtype](**values)


def _texts(name: str, definition: str, form: str) -> dict[str, str]:
    """Returns the definitions in a log by the names of their types, which are valid."""
    unknown = "" if name in typestore().types else f"type {name} is not known, and "
    if not form:
        raise GraphError(f"{unknown}the log does not define it")
    if form not in _DEFINITION_FORMATS:
        raise GraphError(
            f"{unknown}the log defines it as '{form[:20]}'; definitions are read as "
            f"{', '.join(_DEFINITION_FORMATS)}"
        )
    definition = definition.encode(errors="surrogateescape").decode(errors="replace")
    if len(definition) > MAX_DEFINITION_BYTES:
        raise GraphError(
            f"the definition of {name} has more than {MAX_DEFINITION_BYTES} characters"
        )
    written = msg_texts(definition) if form == "ros2idl" else _parts(name, definition)
    if len(written) > MAX_NESTED_TYPES + 1:
        raise GraphError(f"the definition of {name} nests more than {MAX_NESTED_TYPES} types")
    texts = {}
    for long_name, text in written.items():
        parts = _TYPE.fullmatch(long_name)
        if parts is None:
            raise GraphError(f"the log has a type with the name '{long_name[:100]}'")
        texts[f"{parts[1]}/{parts[2] or 'msg'}/{parts[3]}"] = text
    if name not in texts:
        raise GraphError(f"{unknown}the log defines others in its place")
    texts |= _interface_parts(name, texts[name])
    if form == "ros1msg":
        return texts
    return {full: _with_own_header(full, text, texts) for full, text in texts.items()}


def _interface_parts(name: str, text: str) -> dict[str, str]:
    """Returns the parts of a service or an action, whose file a log holds for each of them.

    Such are the events of services (REP 2012, service introspection) and feedback of actions.
    """
    kind = name.split("/")[1]
    sections = _DASHES.split(text)
    base = name.rpartition("_")[0]
    if kind == "srv" and len(sections) == 2:
        request, response = f"{base}_Request", f"{base}_Response"
        event = f"service_msgs/ServiceEventInfo info\n{request}[<=1] request\n"
        event += f"{response}[<=1] response\n"
        return {request: sections[0], response: sections[1], f"{base}_Event": event}
    if kind == "action" and len(sections) == 3:
        feedback = f"unique_identifier_msgs/UUID goal_id\n{base}_Feedback feedback\n"
        names = (f"{base}_Goal", f"{base}_Result", f"{base}_Feedback")
        return {
            **dict(zip(names, sections, strict=True)),
            f"{base}_FeedbackMessage": feedback,
        }
    return {}


def _with_own_header(name: str, text: str, texts: Mapping[str, str]) -> str:
    """Returns a definition in which `Header` is the package's own type, if it has one.

    In ROS 1 it is always that of std_msgs.
    """
    package = name.partition("/")[0]
    own = f"{package}/msg/Header"
    return _HEADER.sub(rf"\1{own}", text) if own in texts else text


def _parts(name: str, definition: str) -> dict[str, str]:
    """Returns the texts of a definition in `.msg` form, with those after lines of `=`."""
    first, *others = _SEPARATOR.split(definition)
    written = {name: first}
    for other in others:
        head = _NESTED.match(other)
        if head is not None:
            written[head[1]] = other[head.end() :]
    return written


def _renamed(texts: Mapping[str, str], *, is_ros1: bool) -> dict[str, str]:
    """Returns new names of the types that differ from the local ones, or contain such types.

    Parts of services and actions, such as the events of services, become messages.
    """
    found = {
        name: parse_definition(text, _as_message(name), name)[0] for name, text in texts.items()
    }
    others = {
        name
        for name, definition in found.items()
        if "/msg/" not in name or _differs(definition, is_ros1=is_ros1)
    }
    before = -1
    while len(others) > before:
        before = len(others)
        others |= {n for n, d in found.items() if any(nested in others for nested, _ in d.nested)}
    digest = sha256("\0".join(f"{n}\0{texts[n]}" for n in sorted(texts)).encode()).hexdigest()[:8]
    parts = {name: name.split("/") for name in others}
    return {name: f"{package}_{digest}/msg/{base}" for name, (package, _, base) in parts.items()}


def _as_message(name: str) -> str:
    package, _, base = name.split("/")
    return f"{package}/msg/{base}"


def _differs(definition: Definition, *, is_ros1: bool) -> bool:
    name = definition.name
    if name not in typestore().fielddefs:
        return False
    if is_ros1:
        names = [field for field, _ in ros1_codec().fields(name)]
        local = list(zip(names, ros1_codec().described(name), strict=True))
    else:
        local = typestore().fielddefs[name][1]
    return list(_shape(local).items()) != list(_shape(definition.fields).items())


def _register(texts: Mapping[str, str], renamed: Mapping[str, str]) -> None:
    """Registers the renamed types and the unknown ones."""
    known = typestore().types
    wanted = {name: renamed.get(name, name) for name in texts}
    new = {name: target for name, target in wanted.items() if target not in known}
    if not new:
        return
    with tempfile.TemporaryDirectory(prefix="volery-types-") as folder:
        for name, target in new.items():
            package, _, base = target.split("/")
            path = Path(folder, package, "msg", f"{base}.msg")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(_with_names(texts, name, renamed), encoding="utf-8")
        add_definitions(folder, foreign=True)


def _with_names(texts: Mapping[str, str], name: str, renamed: Mapping[str, str]) -> str:
    """Returns a type's definition with full names of nested types, some by their new names."""
    package, _, _ = name.partition("/")

    def full_name(match: re.Match[str]) -> str:
        parts = match[2].split("/")
        if len(parts) == 1:
            parts = ["std_msgs" if parts == ["Header"] else package, *parts]
        full = f"{parts[0]}/{parts[1] if len(parts) == 3 else 'msg'}/{parts[-1]}"
        is_type = full in texts or full in typestore().types
        return match[1] + (renamed.get(full, full) if is_type else match[2])

    return "".join(f"{_FIELD_TYPE.sub(full_name, line)}\n" for line in texts[name].splitlines())


def _shape(described: Any) -> dict[str, Any]:
    """Returns fields and their types as far as they determine the bytes: without bounds."""
    return {name: _plain(kind) for name, kind in described if name != EMPTY_MEMBER}


def _plain(described: Any) -> Any:
    kind, detail = described
    if kind == Nodetype.BASE:
        return kind, detail[0]
    if kind == Nodetype.NAME:
        return kind, detail
    inner, size = detail
    return kind, _plain(inner), size if kind == Nodetype.ARRAY else 0
