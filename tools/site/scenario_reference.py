"""Writes the reference of scenarios' keys from the classes of their tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import TypeAdapter
from pydantic.fields import FieldInfo

from volery.scenario import list_scenarios, load_scenario
from volery.scenario.base import Data
from volery.scenario.json_schema import description_of, models, models_in, scenario_schema, unit_of
from volery.scenario.schema import Scenario
from volery.scenario.toml_writer import toml_value

_HEAD = """\
# Keys of scenarios

All tables of a scenario file with their keys. [Scenarios](../scenarios.md) explains them. In Python
each table is a class: see [scenarios in Python](../scenarios_in_python.md). `volery schema` prints
the same as a JSON schema, [for editors](../scenarios.md#editors).
"""
_EXPECTATIONS = [model for model in models() if model.__name__.endswith("Expectation")]
EXAMPLES: dict[str, Any] = {
    "Actor.name": "walker",
    "AttachedActor.actor": "van",
    "AttachedActor.position_m": [-0.4, 0.0, 1.45],
    "CameraSensor.horizontal_fov_deg": 90.0,
    "CameraSensor.samples": 4,
    "City.region_m": [-200.0, -200.0, 200.0, 200.0],
    "Daylight.hour_of_day": 9.5,
    "DeniedBox.height_m": [0.0, 25.0],
    "DeniedBox.region_m": [50.0, 0.0, 120.0, 80.0],
    "DeniedPolygon.corners_m": [[0.0, 0.0], [40.0, 0.0], [20.0, 30.0]],
    "DeniedPolygon.height_m": [0.0, 25.0],
    "DisplacementFault.offset_m": [5.0, 0.0, 0.0],
    "ExternalActor.position_m": [6.0, 0.0],
    "GnssFault.until_s": 40.0,
    "GridMapWorld.map": "random",
    "Gust.amplitude_m_s": [4.0, 0.0, 1.0],
    "Gust.end_s": 26.0,
    "Gust.rise_m": 12.0,
    "Gust.rise_s": 0.5,
    "Gust.start_s": 20.0,
    "GustFault.velocity_m_s": [6.0, 0.0, 0.0],
    "InventoryForest.species_map": {"Quercus alba": "broadleaf"},
    "JammingFault.position_m": [60.0, 0.0, 5.0],
    "JammingFault.until_s": 40.0,
    "LidarSensor.intensities": True,
    "LidarSensor.topic": "points/front",
    "MagneticField.declination_deg": 3.5,
    "MagneticField.inclination_deg": 63.0,
    "MagneticField.strength_ut": 48.0,
    "MotorFault.rotor": 0,
    "MotorFault.until_s": 40.0,
    "RadioFault.until_s": 40.0,
    "Scenario.code_folder": "../nodes",
    "Scenario.message_packages": ["px4_msgs"],
    "SensorFault.bias": [0.0, 0.0, 0.3],
    "SensorFault.effect": "biased",
    "SensorFault.sensor": "imu",
    "SensorFault.sigma": [0.5, 0.5, 0.1],
    "SensorFault.until_s": 40.0,
    **{f"{model.__name__}.name": "a calm flight" for model in _EXPECTATIONS},
    **{
        f"{model.__name__}.until_s": 40.0
        for model in _EXPECTATIONS
        if "until_s" in model.model_fields
    },
    "AreaExpectation.at_least_m2": 400.0,
    "ArrivalExpectation.by_s": 30.0,
    "ArrivalExpectation.position_m": [40.0, 0.0, 5.0],
    "BatteryExpectation.at_least": 0.3,
    "ClearanceExpectation.at_least_m": 1.0,
    "EstimateErrorExpectation.at_most_m": 0.2,
    "FormulaExpectation.formula": "always(z > 1 and speed < 5, 5, 40)",
    "LimitsExpectation.corridor_m": [[0.0, 0.0], [50.0, 0.0], [50.0, 50.0]],
    "LimitsExpectation.height_m": [1.0, 30.0],
    "LimitsExpectation.radius_m": 5.0,
    "LimitsExpectation.region_m": [-10.0, -10.0, 60.0, 60.0],
    "ModesExpectation.by_s": 30.0,
    "ModesExpectation.modes": ["take_off", "land", "landed"],
    "NeesExpectation.at_most": 6.0,
    "PredicateExpectation.function": "own_checks:lands_near",
    "PredicateExpectation.parameters": {"limit_m": 2.0},
    "RealTimeFactorExpectation.at_least": 1.0,
    "SeparationExpectation.at_least_m": 2.0,
    "SpeedExpectation.at_most_m_s": 5.0,
    "Stereo.baseline_m": 0.12,
    "TopicRateExpectation.at_least_hz": 9.0,
    "TopicRateExpectation.topic": "slam/pose",
    "TopicValueExpectation.at_least": 2.0,
    "TopicValueExpectation.at_most": 8.0,
    "TopicValueExpectation.equals": "cruise",
    "TopicValueExpectation.topic": "/v_formation/status",
    "UavType.identified_model": "f450",
    "UserMesh.up": "z",
    "Weather.dust_visibility_m": 300.0,
    "Weather.fog_visibility_m": 150.0,
    "Wind.field": "valley.csv",
    "Wind.w20_m_s": 9.0,
    "World.seed": 1,
    **{
        f"{fault}.uav": "uav1"
        for fault in ("MotorFault", "SensorFault", "GnssFault", "RadioFault", "DisplacementFault")
    },
}
"""Examples of keys that have no default and that no shipped scenario uses."""


def page() -> str:
    """Returns the page."""
    return "\n".join(_parts())


def _parts() -> Iterator[str]:
    yield _HEAD
    schema, shipped, headers = scenario_schema(), _shipped_values(), _headers()
    for model in models():
        node = schema if model is Scenario else schema["$defs"][model.__name__]
        yield from _section(model, node, headers[model], shipped)


def _section(
    model: type[Data], node: dict[str, Any], headers: list[str], shipped: dict[str, Any]
) -> Iterator[str]:
    doc = " ".join((model.__doc__ or "").split("\n\n")[0].split())
    yield f"## {model.__name__}\n\n{doc}\n"
    if headers:
        yield "In a file: " + ", ".join(f"`{header}`" for header in headers) + "\n"
    yield "| key | type | default | description |\n|---|---|---|---|"
    for key, field in model.model_fields.items():
        unit, example = unit_of(key), _example(model, key, field, shipped)
        cells = (
            f"`{key}`",
            _type(node["properties"][key]) + (f", in {unit}" if unit else ""),
            _default(key, field),
            description_of(model, key) + (f"<br>Example: {example}" if example else ""),
        )
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
    yield ""


def _headers() -> dict[type[Data], list[str]]:
    """Returns the headers in TOML of each table."""
    found: dict[type[Data], list[str]] = {Scenario: []}
    for model in models():
        for key, field in model.model_fields.items():
            is_list = "tuple[" in str(field.annotation) or "Actors" in str(field.annotation)
            for inner in models_in(field.annotation):
                for outer in [""] if model is Scenario else found.get(model, []):
                    path = ".".join(part for part in (outer.strip("[]"), key) if part)
                    path += ".NAME" if model is Scenario and key == "types" else ""
                    header = f"[[{path}]]" if is_list else f"[{path}]"
                    if header not in found.setdefault(inner, []):
                        found[inner].append(header)
    return found


def _type(node: dict[str, Any]) -> str:
    """Returns a type of the JSON schema for readers."""
    if "$ref" in node:
        name = node["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    if "const" in node:
        return f"`{json.dumps(node['const'])}`"
    if "enum" in node:
        return ", ".join(f"`{json.dumps(value)}`" for value in node["enum"])
    options = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    if options:
        return " or ".join(_type(option) for option in options)
    if node["type"] in ("array", "object"):
        return _list_type(node) if node["type"] == "array" else _table_type(node)
    word = {"string": "text", "boolean": "true or false"}.get(node["type"], node["type"])
    word = "date" if node.get("format") == "date" else word
    return f"{word}{_bounds(node)}"


def _table_type(node: dict[str, Any]) -> str:
    values = [*node.get("patternProperties", {}).values(), node.get("additionalProperties", True)]
    return f"table of {_type(values[0])}" if isinstance(values[0], dict) else "table"


def _list_type(node: dict[str, Any]) -> str:
    items = node["items"]
    if isinstance(items, list):
        return f"{len(items)} {items[0]['type']}s{_bounds(items[0])}"
    low, high = node.get("minItems"), node.get("maxItems")
    count = "" if low is None and high is None else f"{low or 0} to {high or 'any'} "
    return f"list of {count}{_type(items)}"


def _bounds(node: dict[str, Any]) -> str:
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    parts = [f"{sign} {_number(node[key])}" for key, sign in signs.items() if key in node]
    return f" ({', '.join(parts)})" if parts else ""


def _number(value: float) -> str:
    return "2^63" if value == 2**63 else f"{value:g}"


def _default(key: str, field: FieldInfo) -> str:
    if key == "kind" or field.is_required():
        return "required"
    if field.default_factory is not None:
        return "`{}`"
    if field.default is None:
        return "none"
    if isinstance(field.default, Data):
        return "its defaults"
    return f"`{toml_value(_plain(field.default))}`"


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _example(model: type[Data], key: str, field: FieldInfo, shipped: dict[str, Any]) -> str:
    """Returns an example of a key: of a shipped scenario, of `EXAMPLES`, or its default.

    Empty: the key holds tables, which have examples of their own.
    """
    if any(True for _ in models_in(field.annotation)):
        return ""
    name = f"{model.__name__}.{key}"
    value = EXAMPLES.get(name, shipped.get(name))
    if value is None and not field.is_required():
        value = field.get_default(call_default_factory=True)
    if value is None:
        raise SystemExit(f"{name} has no example; add one to EXAMPLES in {Path(__file__).name}")
    TypeAdapter(Annotated[field.annotation, field]).validate_python(value)
    return f"`{key} = {toml_value(_plain(value))}`"


def _shipped_values() -> dict[str, Any]:
    """Returns the first value of each key in the shipped scenarios, by class and key."""
    found: dict[str, Any] = {}

    def collect(value: Any) -> None:
        if isinstance(value, Data):
            for key in type(value).model_fields:
                inner = getattr(value, key)
                if key in value.model_fields_set and inner is not None:
                    found.setdefault(f"{type(value).__name__}.{key}", inner)
                    collect(inner)
        elif isinstance(value, dict):
            for inner in value.values():
                collect(inner)
        elif isinstance(value, tuple):
            for inner in value:
                collect(inner)

    for name in list_scenarios():
        collect(load_scenario(name))
    return found


if __name__ == "__main__":
    print(page(), end="")
