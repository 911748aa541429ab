"""Writes the JSON schema of scenarios, for editors of TOML files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from volery.core.attribute_docs import attribute_docs
from volery.core.errors import ScenarioError, reason_of
from volery.core.quantities import quantity_of
from volery.core.whole_files import write_whole
from volery.scenario.base import Data
from volery.scenario.schema import Scenario

_UNITS = {"db": "dB", "dbi": "dBi", "dbm": "dBm", "mm_h": "mm/h"}
"""Units by the ending of a key, beside those of `core.quantities`."""


def scenario_schema() -> dict[str, Any]:
    """Returns the JSON schema of scenario files; each key has a description with its unit."""
    schema = Scenario.model_json_schema()
    classes = {model.__name__: model for model in models()}
    for name, node in schema["$defs"].items():
        _describe(node, classes[name])
    _describe(schema, Scenario)
    draft: dict[str, Any] = _as_draft_7(
        {"$schema": "http://json-schema.org/draft-07/schema#", **schema, "title": "Volery scenario"}
    )
    return draft


def schema_text() -> str:
    """Returns the JSON schema of scenario files as text, with a line break at its end."""
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False) + "\n"


def write_schema(path: Path) -> None:
    """Writes the JSON schema of scenario files; raises `ScenarioError` if it cannot."""
    try:
        write_whole(path, schema_text())
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written: {reason_of(error)}") from None


def _as_draft_7(node: Any) -> Any:
    """Returns a schema in the draft that editors of TOML know, without null, which TOML lacks."""
    if isinstance(node, list):
        return [_as_draft_7(item) for item in node]
    if not isinstance(node, dict):
        return node
    options = [option for option in node.get("anyOf", ()) if option != {"type": "null"}]
    if len(options) == 1:
        node = {key: value for key, value in node.items() if key != "anyOf"} | options[0]
    elif options:
        node = {**node, "anyOf": options}
    if "patternProperties" in node:  # names of other patterns are invalid
        node = {**node, "additionalProperties": False}
    return {
        "items" if key == "prefixItems" else key: _as_draft_7(value)
        for key, value in node.items()
        if not _is_left_out(key, value)
    }


def _is_left_out(key: str, value: Any) -> bool:
    """Returns whether an entry is not of this draft, or a default that a table itself describes."""
    is_default_of_table = key == "default" and (value is None or isinstance(value, dict))
    return is_default_of_table or (key == "discriminator" and "propertyName" in value)


def models() -> list[type[Data]]:
    """Returns the classes of all tables of a scenario, each after the table that holds it."""
    found: dict[type[Data], None] = {}
    pending: list[type[Data]] = [Scenario]
    while pending:
        model = pending.pop(0)
        if model not in found:
            found[model] = None
            for field in model.model_fields.values():
                pending += models_in(field.annotation)
    return list(found)


def models_in(annotation: Any) -> Iterator[type[Data]]:
    """Yields the classes of tables in a key's type, such as a list or a union of tables."""
    if isinstance(annotation, type) and issubclass(annotation, Data):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from models_in(inner)


def unit_of(key: str) -> str:
    """Returns the unit that the ending of a key names; empty: it names none."""
    parts = key.split("_")
    for start in range(len(parts)):
        ending = "_".join(parts[start:])
        if ending in _UNITS:
            return _UNITS[ending]
    quantity = quantity_of(key)
    return quantity.unit if quantity is not None else ""


def description_of(model: type[BaseModel], key: str) -> str:
    """Returns the description of a key of a file, in one line without a unit."""
    return " ".join(attribute_docs(model).get(key, "").split()).replace("None:", "absent:")


def _describe(node: dict[str, Any], model: type[Data]) -> None:
    """Adds descriptions to the keys of a table, and requires its `kind`."""
    properties = node.get("properties", {})
    for key, value in properties.items():
        value.pop("title", None)
        unit = unit_of(key)
        text = description_of(model, key)
        value["description"] = f"{text} Unit: {unit}." if unit else text
    if "kind" in properties:
        properties["kind"].pop("default", None)
        node["required"] = ["kind", *(k for k in node.get("required", ()) if k != "kind")]
