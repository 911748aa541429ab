"""Validates plain data against models, with errors that name key and allowed values."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss
from volery.scenario.fault_texts import fault_text

Model = TypeVar("Model", bound=BaseModel)

_MAX_SHOWN = 60
"""Characters of a value in an error."""


def validated(data: Any, model: type[Model], where: str) -> Model:
    """Returns plain data as a model.

    where: names the source in errors. Raises `ScenarioError`, naming key and allowed values, for
    invalid data.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(describe_validation_error(error, where, model, data)) from None


def describe_validation_error(
    error: ValidationError, where: str, model: type[BaseModel], data: Any
) -> str:
    """Returns one line per fault: file, key, found value and allowed values.

    `data` is the validated input, which distinguishes keys from pydantic's names of union branches.
    """
    faults = error.errors()
    inner = [f["loc"] for f in faults]
    # A list with an invalid item is also reported as too short, which is redundant.
    faults = [
        f
        for f in faults
        if f["type"] != "too_short"
        or not any(len(p) > len(f["loc"]) and p[: len(f["loc"])] == f["loc"] for p in inner)
    ]
    lines = [_describe(fault, model, data) for fault in faults]
    if len(lines) == 1:
        return f"{where}: {lines[0]}"
    return f"{where}: {len(lines)} faults\n" + "\n".join(f"  {line}" for line in lines)


def _describe(fault: Any, model: type[BaseModel], data: Any) -> str:
    key = _key(fault["loc"], data, keep_last=fault["type"] == "missing")
    message = fault_text(fault)
    if fault["type"] == "extra_forbidden":
        allowed = _sibling_keys(model, fault["loc"])
        hint = near_miss(fault["loc"][-1], allowed)
        return f"unknown key '{key}'{hint} Allowed here: {', '.join(allowed)}"
    if fault["type"] == "union_tag_invalid":
        return f"key '{key}.kind': {message}"
    if fault["type"] == "union_tag_not_found":
        key += ".kind"
    if fault["type"] in ("missing", "union_tag_not_found"):
        return f"key '{key}' is missing"
    if not key:
        return message
    one_table = fault["type"] == "tuple_type" and isinstance(fault.get("input"), dict)
    if one_table and _names_tables(model, fault["loc"]):
        return f"key '{key}': there may be several of them; write [[{key}]], not [{key}]"
    found = fault.get("input")
    shown = f" (found {_short(found)})" if isinstance(found, str | int | float | bool) else ""
    return f"key '{key}': {message}{shown}"


def _short(value: str | float) -> str:
    """Returns a value for an error: a token, not the text of a file."""
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."


def _key(location: tuple[int | str, ...], data: Any, *, keep_last: bool) -> str:
    key = ""
    tagged: Any = None
    for position, part in enumerate(location):
        if isinstance(data, dict) and data.get("kind") == part and data is not tagged:
            tagged = data  # the name of a union branch, even if a key has the same name
            continue
        is_key = isinstance(part, int) or (isinstance(data, dict) and part in data)
        if not is_key and not (keep_last and position == len(location) - 1):
            continue  # the name of a union branch
        if isinstance(data, dict):
            data = data.get(part)
        elif isinstance(data, list | tuple) and isinstance(part, int):
            data = data[part] if part < len(data) else None
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else str(part)
    return key


def _names_tables(model: type[BaseModel], location: tuple[int | str, ...]) -> bool:
    """Returns whether the key is the header of an array of tables."""
    schema = model.model_json_schema()
    node: Any = schema
    for part in location:
        node = _descend(schema, node, part)
    items = _resolve(schema, node.get("items", {}))
    nested = any(isinstance(part, int) for part in location)
    return not nested and ("oneOf" in items or "properties" in items)


def _sibling_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Returns the keys allowed at the position of the unknown key, from the JSON schema."""
    schema = model.model_json_schema()
    node: Any = schema
    for part in location[:-1]:
        node = _descend(schema, node, part)
    node = _resolve(schema, node)
    return sorted(node.get("properties", {}))


def _resolve(schema: Any, node: Any) -> Any:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node


def _descend(schema: Any, node: Any, part: int | str) -> Any:
    node = _resolve(schema, node)
    if isinstance(part, int):
        return _resolve(schema, node.get("items", {}))
    if part in node.get("properties", {}):
        return _resolve(schema, node["properties"][part])
    for option in (*node.get("oneOf", ()), *node.get("anyOf", ())):
        found = _resolve(schema, option)
        kind = found.get("properties", {}).get("kind", {})
        if part == kind.get("const") or part in found.get("properties", {}):
            return found if part == kind.get("const") else _descend(schema, found, part)
        if "oneOf" in found:
            return _descend(schema, found, part)
    extra = node.get("additionalProperties") or node.get("patternProperties", {})
    if isinstance(extra, dict) and extra:
        inner = extra if ("$ref" in extra or "type" in extra) else next(iter(extra.values()))
        return _resolve(schema, inner)
    return {}
