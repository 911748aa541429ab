"""The scenario: frozen data that defines a simulation, validated on construction.

Keys contain their units (`_m`, `_deg`, `_hz`, ...). A TOML file maps onto `Scenario` one to one;
docs/scenarios.md explains it; `volery schema` prints its JSON schema for editors.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from volery.core.errors import ScenarioError, reason_of
from volery.core.plurals import counted
from volery.core.whole_files import write_whole
from volery.scenario.access import ScenarioAccess
from volery.scenario.base import Data, Name
from volery.scenario.expectations import Expectation
from volery.scenario.faults import Fault
from volery.scenario.file_names import moved
from volery.scenario.node_names import node_module
from volery.scenario.python_changes import split_changes, with_keys, with_short_forms
from volery.scenario.radio import Radio
from volery.scenario.sensors import (
    BatterySensor,
    EstimateSensor,
    ExternalOdometrySource,
    GroundTruthSensor,
    ImuSensor,
    LidarSensor,
    Nodding,
    OdometrySensor,
    Sensor,
    SonarSensor,
)
from volery.scenario.toml_writer import SCHEMA_DIRECTIVE, toml_text
from volery.scenario.uavs import Flight, KinematicMotion, NodeEntry, RotorWear, UavGroup, UavType
from volery.scenario.validation import validated
from volery.scenario.world import FlatTerrain, GridTerrain, InventoryForest, ProceduralForest, World

__all__ = [
    "BatterySensor",
    "EstimateSensor",
    "ExternalOdometrySource",
    "FlatTerrain",
    "Flight",
    "GridTerrain",
    "GroundTruthSensor",
    "ImuSensor",
    "InventoryForest",
    "KinematicMotion",
    "LidarSensor",
    "Nodding",
    "NodeEntry",
    "OdometrySensor",
    "Physics",
    "ProceduralForest",
    "RotorWear",
    "Scenario",
    "Sensor",
    "SonarSensor",
    "UavGroup",
    "UavType",
    "World",
]


class Physics(Data):
    """Physics step and effect of contacts."""

    rate_hz: Annotated[int, Field(ge=200, le=4000)] = 1000
    """Rate of physics steps; it divides 1e9."""
    guidance_rate_hz: Annotated[int, Field(ge=25, le=1000)] = 125
    """Rate of flight modes and outer loop, in whole physics steps; attitude control runs at 250 Hz
    or at this rate, if higher."""
    on_contact: Literal["crash", "bounce"] = "crash"
    """Effect of a hard contact: the UAV crashes, or it bounces and flies on."""


class Scenario(Data):
    """A complete simulation, as data."""

    name: Name
    """Name of the scenario, in lower case."""
    description: str = ""
    """Description in one line; `volery list` shows it."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """Seed of all random streams."""
    duration_s: Annotated[float, Field(gt=0.0, le=1_000_000.0)] = 60.0
    """Simulated time after which the run ends."""
    ends_when: Literal["time_is_up", "all_landed"] = "time_is_up"
    """End of the run: after `duration_s`, or earlier, when all UAVs have landed."""
    physics: Physics = Physics()
    """Physics step and effect of contacts."""
    world: World = World()
    """Ground, trees, buildings, actors, air."""
    radio: Radio | None = None
    """Packet radio of the UAVs; None: they have none."""
    types: Annotated[dict[Name, UavType], Field(min_length=1)]
    """Types of UAVs by name."""
    uavs: Annotated[tuple[UavGroup, ...], Field(min_length=1)]
    """Groups of UAVs, which are named uav1, uav2, ... in this order."""
    nodes: tuple[NodeEntry, ...] = ()
    """Nodes of the whole system, one of each; their relative names start at the root."""
    faults: tuple[Fault, ...] = ()
    """Faults at set times."""
    expect: tuple[Expectation, ...] = ()
    """What a flight is expected to do; `volery test` and `volery.verdicts` judge it."""
    message_packages: tuple[str, ...] = ()
    """Folders of ROS packages whose `.msg`, `.srv` and `.action` files the nodes use."""
    code_folder: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    """Folder of the scenario's own modules: nodes and predicates; None: that of its file."""

    _access: ScenarioAccess = PrivateAttr(default_factory=ScenarioAccess)

    @model_validator(mode="after")
    def _types_exist(self) -> Self:
        for i, group in enumerate(self.uavs):
            if group.type not in self.types:
                known = ", ".join(sorted(self.types))
                raise ValueError(f"uavs[{i}].type '{group.type}' is not defined; known: {known}")
        return self

    @model_validator(mode="after")
    def _physics_period_is_whole(self) -> Self:
        if 1_000_000_000 % self.physics.rate_hz:
            raise ValueError("physics.rate_hz must divide 1e9, e.g. 200, 250, 400, 500, 1000")
        return self

    @property
    def world_seed(self) -> int:
        """Seed of the world."""
        return self.seed if self.world.seed is None else self.world.seed

    @property
    def has_seeded_world(self) -> bool:
        """Whether the scenario's seed affects trees or a city, for lack of `world.seed`."""
        world = self.world
        return world.seed is None and (world.forest is not None or world.city is not None)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in type(self).model_fields:
            raise ScenarioError(
                f"{name}: scenarios do not change; with_({name}=...) returns a copy"
            )
        super().__setattr__(name, value)

    def with_(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> Scenario:
        """Returns a copy with other values of its keys, validated like a file.

        Tables merge key by key, all else is replaced; `with_(seed=7, world={"seed": 1})` leaves the
        rest of the world unchanged. `changes` may also hold paths of keys:
        `{"world.wind.turbulence": "light", "uavs[0].yaw_deg": 90.0, "types.*.airframe": "iris"}`.

        Short forms: `uavs` (a number) resizes the only group; `wind` is a velocity (3,), m/s in
        the map, or a table; `weather` is a table; `airframe` and `sensors` change all types.
        `sensors` are sets ("lidar", "camera", "sonar", "navigation"), which are added or kept while
        sensors of other sets are removed, or all sensors as tables or models. Raises
        `ScenarioError`, naming key and allowed values, for invalid values.
        """
        where = self.name
        given = {**(changes or {}), **keys}
        short, long = split_changes(given, type(self).model_fields, where)
        changed = validated(with_keys(self.data(), long, where), Scenario, where)
        if short:
            data = with_short_forms(changed.data(), short, where)
            changed = validated(data, Scenario, where)
        return changed.with_access(self.access)

    def expecting(self, kind: str, **keys: Any) -> Scenario:
        """Returns a copy with one more expectation: `expecting("separation", at_least_m=2.0)`.

        The keys are those of the expectation in a file. Raises `ScenarioError`, naming key and
        allowed values, for invalid ones.
        """
        return self.with_(expect=[*self.data().get("expect", ()), {"kind": kind, **keys}])

    def data(self) -> dict[str, Any]:
        """Returns the given keys as plain data: tables, lists, numbers, texts and dates."""
        return self.model_dump(exclude_unset=True)

    def to_toml(self) -> str:
        """Returns the given keys as TOML, which loads to an equal scenario.

        Raises `ScenarioError` if a node's parameter is something that TOML does not have.
        """
        return toml_text(self.model_dump(exclude_unset=True, exclude_none=True))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes a TOML file, which `load_scenario` loads to an equal scenario.

        Its first line names `scenario.schema.json` for editors; `volery schema` writes that. Names
        of files in this scenario's folder become relative to the new file's folder; if its own
        modules are there, `code_folder` names it. A saved
        scenario of a log or an upload has, when it is loaded, the access of its new owner. Raises
        `ScenarioError` if the file exists, unless `overwrite` is set, or cannot be written.
        """
        path = Path(path)
        if path.suffix != ".toml":
            raise ScenarioError(f"{path}: a scenario is a .toml file; name it {path.name}.toml")
        data = self.model_dump(exclude_unset=True, exclude_none=True)
        folder = self.access.folder or Path()
        if folder.resolve() != path.parent.resolve() and self._has_code_in(folder):
            data.setdefault("code_folder", ".")
        text = toml_text(moved(data, self.access.folder, path.parent))
        try:
            write_whole(path, f"{SCHEMA_DIRECTIVE}\n\n{text}", overwrite=overwrite)
        except FileExistsError:
            raise ScenarioError(f"{path}: the file exists; overwrite=True replaces it") from None
        except OSError as error:
            raise ScenarioError(f"{path}: cannot be written: {reason_of(error)}") from None

    def __eq__(self, other: object) -> bool:
        """Returns whether the other scenario has the same values; access does not count."""
        return isinstance(other, Scenario) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((self.name, self.seed, self.uavs))

    @property
    def access(self) -> ScenarioAccess:
        """Access to files and code; see `load_scenario`."""
        return self._access

    def with_access(self, access: ScenarioAccess) -> Scenario:
        """Returns the same scenario with another access."""
        changed = self.model_copy()
        changed._access = access.with_code_in(self.code_folder)
        return changed

    @property
    def node_entries(self) -> tuple[NodeEntry, ...]:
        """All entries of nodes: those of UAV types, then those of the whole system."""
        return (*(entry for kind in self.types.values() for entry in kind.nodes), *self.nodes)

    @property
    def uav_count(self) -> int:
        """Number of UAVs in all groups."""
        return sum(group.count for group in self.uavs)

    def _has_code_in(self, folder: Path) -> bool:
        """Returns whether a folder has modules that nodes or predicates of this scenario name."""
        named = [node_module(entry.node) for entry in self.node_entries]
        named += [e.function.partition(":")[0] for e in self.expect if e.kind == "predicate"]
        tops = {module.partition(".")[0] for module in named if module is not None}
        return any((folder / f"{top}.py").is_file() or (folder / top).is_dir() for top in tops)

    def __repr__(self) -> str:
        types = ", ".join(dict.fromkeys(group.type for group in self.uavs))
        parts = ("forest", "city", "grid_map")
        there = [part.replace("_", " ") for part in parts if getattr(self.world, part) is not None]
        there += ["meshes"] if self.world.meshes else []
        ground = "open ground" if self.world.terrain.kind == "flat" else "terrain"
        return (
            f"<Scenario '{self.name}': {counted(self.uav_count, 'UAV')} ({types}), "
            f"{' and '.join(there) or ground}, {self.duration_s:g} s, seed {self.seed}>"
        )

    __str__ = __repr__
