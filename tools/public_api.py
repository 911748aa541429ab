"""Lists the public API: every public name with its members and signatures.

    python tools/public_api.py            # renew tests/api/public_api.txt
    python tools/public_api.py --check    # report what differs from it

Public are the names of `__all__` of the modules in `MODULES`, and the classes in `HANDLES`, which
users receive from those and do not construct. Private names begin with an underscore.
docs/api_stability.md says how the public API may change.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from volery.core.attribute_docs import attribute_docs

MODULES = (
    "volery",
    "volery.grading",
    "volery.logs",
    "volery.results",
    "volery.scenario",
    "volery.verdicts",
)
HANDLES: dict[str, tuple[str, ...]] = {
    "volery.engine.events:Event": (),
    "volery.engine.events:EventKind": (),
    "volery.graph.graph:Graph": (
        "advertise",
        "call",
        "services",
        "subscribe",
        "topics",
    ),
    "volery.graph.messages:Published": (),
    "volery.logs.topic_count:TopicCount": (),
    "volery.runtime.environment_block:EnvironmentEvent": (),
    "volery.runtime.environment_sensors:EnvironmentSensor": (),
    "volery.runtime.environment_sensors:EnvironmentSensors": (),
    "volery.runtime.facets.clock:SimulationClock": (),
    "volery.runtime.facets.diagnostics:SimulationDiagnostics": (),
    "volery.runtime.facets.faults:SimulationFaults": (),
    "volery.runtime.facets.vehicles:SimulationVehicles": (),
    "volery.runtime.facets.world:SimulationWorld": (),
    "volery.runtime.flight_recorder:FlightRecorder": (),
    "volery.runtime.monitoring.progress:Progress": (),
    "volery.runtime.vehicles.flight_future:CommandResult": (),
    "volery.runtime.vehicles.flight_future:FlightFuture": (),
    "volery.runtime.vehicles.sample_stream:SampleStream": (),
    "volery.runtime.vehicles.uav:Uav": (),
    "volery.runtime.vehicles.uav_sensors:UavSensor": (),
    "volery.runtime.vehicles.uav_sensors:UavSensors": (),
    "volery.runtime.vehicles.uav_sensors:UnknownSensorError": (),
    "volery.sensors.sensor_samples:BatterySample": (),
    "volery.sensors.sensor_samples:CameraSample": (),
    "volery.sensors.sensor_samples:GnssSample": (),
    "volery.sensors.sensor_samples:ImuSample": (),
    "volery.sensors.sensor_samples:LidarSample": (),
    "volery.sensors.sensor_samples:MagneticSample": (),
    "volery.sensors.sensor_samples:PoseSample": (),
    "volery.sensors.sensor_samples:PressureSample": (),
    "volery.sensors.sensor_samples:RangeSample": (),
    "volery.vehicle.fleet:FleetState": (),
}
"""Classes of objects that users receive, and their public members; empty: all."""

FILE = Path(__file__).parents[1] / "tests" / "api" / "public_api.txt"
_HEAD = """\
# The public API of Volery; see docs/api_stability.md. Renew it with `python tools/public_api.py`.
"""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_OPENED = frozenset({"__enter__", "__exit__"})
_OF_PYDANTIC = frozenset({"model_post_init"})


class Entry(NamedTuple):
    """A public name."""

    name: str
    """Full name, such as `volery.Simulation.run`."""
    declaration: str
    """Signature, annotation or value."""
    doc: str
    """Docstring; empty: none."""

    @property
    def line(self) -> str:
        """The line of the list."""
        return f"{self.name}{self.declaration}"


def entries() -> list[Entry]:
    """Returns all public names, sorted, each once."""
    found: dict[str, Entry] = {}
    listed: set[int] = set()
    for module_name in MODULES:
        module = import_module(module_name)
        for name in sorted(module.__all__):
            value = getattr(module, name)
            if id(value) in listed:  # exported by another public module, too
                found[f"{module_name}.{name}"] = _alias(f"{module_name}.{name}", value)
                continue
            listed.add(id(value))
            for entry in _entries_of(f"{module_name}.{name}", value, ()):
                found[entry.name] = entry
    for path, members in HANDLES.items():
        module_name, _, name = path.partition(":")
        value = getattr(import_module(module_name), name)
        for entry in _entries_of(f"{module_name}.{name}", value, members):
            found[entry.name] = entry
    return [found[name] for name in sorted(found)]


def _alias(name: str, value: Any) -> Entry:
    return Entry(name, f" is {value.__module__}.{value.__qualname__}", inspect.getdoc(value) or "")


def _entries_of(name: str, value: Any, members: tuple[str, ...]) -> Iterator[Entry]:
    if not isinstance(value, type):
        yield Entry(name, _signature(value), inspect.getdoc(value) or "")
        return
    bases = ", ".join(base.__name__ for base in value.__bases__ if base is not object)
    yield Entry(name, f": class({bases})" if bases else ": class", value.__doc__ or "")
    if not members:
        yield from _constructor(name, value)
    docs = attribute_docs(value)
    for member, (declaration, doc) in sorted(_members(value).items()):
        if not members or member in members:
            yield Entry(f"{name}.{member}", declaration, doc or docs.get(member, ""))


def _constructor(name: str, cls: type) -> Iterator[Entry]:
    """Yields the constructor, if it has a signature of its own; that of a model is its fields."""
    own = next(base for base in cls.__mro__ if "__init__" in vars(base))
    if not issubclass(cls, BaseModel | Enum) and own.__module__.startswith("volery"):
        docs = attribute_docs(cls).values() if is_dataclass(cls) else ()
        doc = "\n".join((cls.__doc__ or "", *docs))
        yield Entry(f"{name}.__init__", _signature(vars(own)["__init__"]), doc)


def _members(cls: type) -> dict[str, tuple[str, str]]:
    """Returns declaration and docstring of each public member that Volery defines."""
    found: dict[str, tuple[str, str]] = {}
    for base in reversed(cls.__mro__):
        if not base.__module__.startswith("volery"):
            continue
        for member, annotation in inspect.get_annotations(base).items():
            if not member.startswith("_") and "ClassVar" not in str(annotation):
                found[member] = f": {_annotation(annotation)}{_default(cls, member)}", ""
        for member in _set_in_constructor(base):
            found.setdefault(member, ("", ""))
        for member, value in vars(base).items():
            described = _described(cls, member, value)
            if described is not None:
                found[member] = described
    return found


def _described(cls: type, member: str, value: Any) -> tuple[str, str] | None:
    """Returns declaration and docstring of a function, property or enumerated value."""
    if (member.startswith("_") and member not in _OPENED) or member in _OF_PYDANTIC:
        return None
    if issubclass(cls, Enum) and isinstance(value, cls):
        return f" = {value.value!r}", ""
    if isinstance(value, classmethod | staticmethod):
        kind = type(value).__name__
        return f"{_signature(value.__func__)} [{kind}]", inspect.getdoc(value.__func__) or ""
    if inspect.isfunction(value):
        doc = "Opens and closes with `with`." if member in _OPENED else inspect.getdoc(value)
        return _signature(value), doc or ""
    getter = getattr(value, "fget", None) or getattr(value, "func", None)
    if getter is not None:
        annotation = inspect.get_annotations(getter).get("return", "Any")
        return f": {annotation} [property]", inspect.getdoc(getter) or ""
    return None


def _annotation(annotation: Any) -> str:
    """Returns an annotation as the source has it; that of a NamedTuple is a ForwardRef."""
    return str(getattr(annotation, "__forward_arg__", annotation))


def _set_in_constructor(cls: type) -> list[str]:
    """Returns the public attributes that a class's own `__init__` sets."""
    constructor = vars(cls).get("__init__")
    if not inspect.isfunction(constructor) or issubclass(cls, BaseModel):
        return []
    if constructor.__code__.co_filename.startswith("<"):  # of a dataclass
        return []
    tree = ast.parse(textwrap.dedent(inspect.getsource(constructor)))
    return [
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
        and not node.attr.startswith("_")
    ]


def _default(cls: type, member: str) -> str:
    if issubclass(cls, BaseModel) and member in cls.model_fields:
        field = cls.model_fields[member]
        if field.default_factory is not None:
            return " = {}"
        if isinstance(field.default, BaseModel):
            return f" = {type(field.default).__name__}()"
        return "" if field.default is PydanticUndefined else f" = {field.default!r}"
    default = vars(cls).get(member, PydanticUndefined)
    is_plain = isinstance(default, bool | int | float | str | tuple | None)
    return f" = {default!r}" if is_plain else ""


class _Bare(str):
    """A text that is shown without quotes: an annotation in a signature."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _bare(annotation: Any) -> Any:
    return _Bare(annotation) if isinstance(annotation, str) else annotation


def _signature(function: Any) -> str:
    signature = inspect.signature(function)
    parameters = [
        parameter.replace(annotation=_bare(parameter.annotation))
        for parameter in signature.parameters.values()
    ]
    signature = signature.replace(
        parameters=parameters, return_annotation=_bare(signature.return_annotation)
    )
    return _ADDRESS.sub("", str(signature))


def text() -> str:
    """Returns the list."""
    return _HEAD + "".join(f"{entry.line}\n" for entry in entries())


def differences() -> list[str]:
    """Returns the lines that differ between the committed list and the code."""
    committed = FILE.read_text(encoding="utf-8").splitlines() if FILE.exists() else []
    lines = difflib.unified_diff(committed, text().splitlines(), "committed", "code", lineterm="")
    return [line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]


def main() -> int:
    """Renews or checks the list."""
    if "--check" in sys.argv[1:]:
        found = differences()
        print("\n".join(found))
        return 1 if found else 0
    FILE.write_text(text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
