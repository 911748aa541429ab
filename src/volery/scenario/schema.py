"""The scenario: frozen data that defines a simulation, validated on construction.

Keys contain their units (`_m`, `_deg`, `_hz`, ...). A TOML file maps onto `Scenario` one to one;
docs/scenarios.md explains it; `volery schema` prints its JSON schema for editors.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from volery.core.errors import ScenarioError, reason_of
from volery.scenario.access import ScenarioAccess
from volery.scenario.actors import Actors, check_actors
from volery.scenario.base import (
    Data,
    MountedSensor,
    Name,
    NonNegative,
    Positive,
    Rate,
    SensorData,
    Topic,
    Vector2,
    check_rectangle,
    renamed,
)
from volery.scenario.camera import CameraSensor, Daylight
from volery.scenario.city import City
from volery.scenario.faults import Fault
from volery.scenario.file_names import moved
from volery.scenario.former_parameters import former_parameters
from volery.scenario.grid_map import GridMapWorld
from volery.scenario.navigation import DeniedArea, MagneticField, NavigationSensor, Origin
from volery.scenario.node_names import NODE_PATTERN, name_of_class
from volery.scenario.python_changes import split_changes, with_keys, with_short_forms
from volery.scenario.radio import Radio
from volery.scenario.toml_writer import toml_text
from volery.scenario.user_mesh import UserMesh
from volery.scenario.validation import validated
from volery.scenario.weather import Weather
from volery.scenario.wind import Wind

# ------------------------------------------------------------------------------------------ world


class FlatTerrain(Data):
    """Horizontal ground from -extent_m to extent_m in x and y."""

    kind: Literal["flat"] = "flat"
    extent_m: Positive = 500.0
    height_m: float = 0.0


class GridTerrain(Data):
    """A heightfield from a CSV grid: row k holds the elevations at y = k * spacing."""

    kind: Literal["grid"] = "grid"
    file: str
    spacing_m: Positive
    origin_m: Vector2 = (0.0, 0.0)


class InventoryForest(Data):
    """Trees at surveyed positions: CSV with `x_m,y_m[,dbh_cm,height_m,species]`."""

    kind: Literal["inventory"] = "inventory"
    file: str
    species: str
    """Species of trees without one in the inventory, or with one that is neither shipped nor
    mapped."""
    species_map: Annotated[dict[str, str], Field(max_length=10_000)] = Field(default_factory=dict)
    """Shipped species by the inventory's names of species."""
    region_m: tuple[float, float, float, float] | None = None
    """x_min, y_min, x_max, y_max; only trees with x_min <= x < x_max (y alike) are used. None uses
    all."""
    fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Fraction of the trees, at random; a smaller fraction is a subset of a larger one."""

    former_keys: ClassVar[Mapping[str, str]] = {"share": "fraction"}

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self


class ProceduralForest(Data):
    """Trees at random positions with a minimum spacing."""

    kind: Literal["procedural"] = "procedural"
    region_m: tuple[float, float, float, float]
    trees: Annotated[int, Field(ge=0, le=200_000)]
    minimum_spacing_m: NonNegative = 1.0
    species: Annotated[dict[str, Positive], Field(min_length=1)]
    """Fractions by species; they are normalised."""

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self


class World(Data):
    """Ground, trees, buildings, actors, air."""

    former_keys: ClassVar[Mapping[str, str]] = {"things": "actors"}

    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    """Seed of the world alone; None: the scenario's seed is used."""
    terrain: Annotated[FlatTerrain | GridTerrain, Field(discriminator="kind")] = FlatTerrain()
    forest: Annotated[InventoryForest | ProceduralForest | None, Field(discriminator="kind")] = None
    city: City | None = None
    grid_map: GridMapWorld | None = None
    meshes: Annotated[tuple[UserMesh, ...], Field(max_length=1000)] = ()
    """Mesh files of the user."""
    actors: Actors = ()
    wind: Wind = Wind()
    weather: Weather = Weather()
    light: Daylight = Daylight()
    origin: Origin = Origin()
    magnetic_field: MagneticField = MagneticField()
    gnss_denied: bool = False
    """Whether satellite signals are denied everywhere, for the whole run."""
    gnss_denied_areas: tuple[DeniedArea, ...] = ()

    @model_validator(mode="after")
    def _actors_have_names(self) -> Self:
        check_actors(self.actors)
        return self


# ------------------------------------------------------------------------------- sensors and UAVs


class Nodding(Data):
    """Sinusoidal tilt of a mount about the sensor's y axis (positive tilts downward)."""

    amplitude_deg: Annotated[float, Field(gt=0.0, le=90.0)] = 45.0
    period_s: Annotated[float, Field(ge=0.1, le=60.0)] = 2.0
    offset_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 0.0
    phase_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0


class LidarSensor(MountedSensor):
    """A LIDAR of a named model: planar, with many rings, or with a rosette."""

    kind: Literal["lidar"] = "lidar"
    name: Name = "horizontal"
    model: str = "utm_30lx"
    topic: Topic | None = None
    """Topic below the UAV's name; None: `laser/NAME/scan` for a planar scanner, else `points`."""
    intensities: bool | None = None
    """Whether echoes have intensities; None: the model's default."""
    nodding: Nodding | None = None


class ImuSensor(MountedSensor):
    """Accelerometer and gyroscope of a named model."""

    kind: Literal["imu"] = "imu"
    name: Name = "imu"
    model: str = "adis16448"
    rate_hz: Rate = 200.0


class SonarSensor(MountedSensor):
    """Downward ultrasonic range finder."""

    kind: Literal["sonar"] = "sonar"
    name: Name = "range"
    model: str = "downward_sonar"
    rate_hz: Rate = 10.0


class OdometrySensor(SensorData):
    """Pose and velocity from an odometry source: true motion plus a modelled drift."""

    kind: Literal["odometry"] = "odometry"
    name: Literal["odom"] = "odom"
    noise: bool = True
    model: str = "visual_inertial"
    rate_hz: Rate = 50.0


class ExternalOdometrySource(Data):
    """Odometry of a node, such as a SLAM's, that aids an estimator; assumed to be in the map frame.

    Covariances of such odometry state its drift from the map. The UAV flies in the frame of the
    odometry, where its errors are those of one pose relative to the next: `sigma_m`, `sigma_deg`.
    """

    topic: Topic
    """Topic of type nav_msgs/Odometry, below the UAV's name."""
    sigma_m: Annotated[float, Field(gt=0.0, le=100.0)] = 0.05
    sigma_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 1.0
    rate_hz: Rate = 10.0
    """Maximum rate of poses: closer ones repeat each other's errors."""


class EstimateSensor(SensorData):
    """Output of the UAV's estimator, as odometry; it needs an IMU."""

    kind: Literal["estimate"] = "estimate"
    name: Literal["odom"] = "odom"
    rate_hz: Rate = 50.0
    used_for_control: bool = True
    """Whether the UAV's controllers use the estimate; false: ground truth."""
    external_odometry: ExternalOdometrySource | None = None

    former_keys: ClassVar[Mapping[str, str]] = {
        "flies": "used_for_control",
        "pose": "external_odometry",
    }


class GroundTruthSensor(SensorData):
    """The true state, for reports and checks; autonomy must not read it."""

    kind: Literal["ground_truth"] = "ground_truth"
    name: Literal["ground_truth"] = "ground_truth"
    rate_hz: Rate = 50.0


class BatterySensor(SensorData):
    """Battery monitor: voltage, current and charge, if the airframe has a battery."""

    kind: Literal["battery"] = "battery"
    name: Literal["battery"] = "battery"
    rate_hz: Rate = 1.0


Sensor = Annotated[
    LidarSensor
    | ImuSensor
    | SonarSensor
    | OdometrySensor
    | EstimateSensor
    | GroundTruthSensor
    | CameraSensor
    | NavigationSensor
    | BatterySensor,
    Field(discriminator="kind"),
]


_TAKEN_NAMES = (
    "base_link",
    "battery",
    "cmd_vel",
    "flight_state",
    "goal_pose",
    "ground_truth",
    "hold",
    "joint_states",
    "land",
    "mavlink",
    "mavros",
    "odom",
    "radio",
    "return_home",
    "rotor_speeds",
    "setpoint_raw",
    "take_off",
    "trajectory",
)
"""Frames, topics and services of a UAV that sensors cannot use as names ..."""
_OWN_NAMES = ("lidar", "odometry", "estimate", "ground_truth", "battery")
"""... except for kinds with a fixed name, and LIDARs, whose topics have a prefix."""


class Flight(Data):
    """Parameters of the flight modes of this type of UAV."""

    take_off_altitude_m: Annotated[float, Field(ge=0.3, le=500.0)] = 2.5
    """Height above the take-off position."""
    return_altitude_m: Annotated[float, Field(ge=0.3, le=500.0)] = 10.0
    command_timeout_s: Annotated[float, Field(ge=0.05, le=60.0)] = 0.5
    """Time without a velocity command after which the UAV holds its position."""


class NodeEntry(Data):
    """A node that runs inside the simulation, in lock step: for one UAV, or for all of them."""

    node: Annotated[str, Field(pattern=NODE_PATTERN)]
    """A registered name, such as `slam`, or `module:Class`; in Python also a class of its own."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    latency_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Simulated time from a callback's input to its output; above 0 the node runs on a worker."""

    @field_validator("node", mode="before")
    @classmethod
    def _name_the_class(cls, node: Any) -> Any:
        return name_of_class(node) if isinstance(node, type) else node

    @field_validator("parameters")
    @classmethod
    def _rename_former_parameters(
        cls, parameters: dict[str, Any], info: ValidationInfo
    ) -> dict[str, Any]:
        node = info.data.get("node", "")
        return renamed(parameters, former_parameters(node), f"{node}: parameter")


class RotorWear(Data):
    """Wear of a rotor and its motor, as factors of a new one's numbers."""

    thrust: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    """Thrust; 0: a failed motor, which is stopped."""
    torque: Annotated[float, Field(ge=0.1, le=10.0)] = 1.0
    """Reaction torque, and so the power."""
    lag: Annotated[float, Field(ge=0.1, le=10.0)] = 1.0
    """Times of speeding up and slowing down."""


class KinematicMotion(Data):
    """Response of a kinematic UAV to velocity commands."""

    time_constant_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """First-order lag of velocity and yaw rate; 0: at once."""
    limited: bool = False
    """Whether the airframe's limits of speed, climb, descent and yaw rate apply."""


class UavType(Data):
    """A type of UAV: airframe, plant, sensors and nodes."""

    airframe: str = "f450"
    plant: Literal["rigid_body", "identified", "kinematic"] = "rigid_body"
    """Model of motion; the airframe defines size and limits for all of them."""
    identified_model: str | None = None
    """Model of an identified plant: a shipped name or a .toml path; None: the airframe's name."""
    kinematic: KinematicMotion = KinematicMotion()
    wear: tuple[RotorWear, ...] = ()
    """One entry per rotor, in the order of the airframe; empty: all are new."""
    battery_charge: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Fraction of the capacity at the start, if the airframe has a battery."""
    flight: Flight = Flight()
    sensors: tuple[Sensor, ...] = ()
    nodes: tuple[NodeEntry, ...] = ()
    radio: bool = True
    """Whether the UAV has a radio, if the scenario has `[radio]`."""

    @model_validator(mode="after")
    def _settings_are_of_the_plant(self) -> Self:
        if self.identified_model is not None and self.plant != "identified":
            raise ValueError(f"identified_model needs plant = \"identified\", not '{self.plant}'")
        if self.kinematic != KinematicMotion() and self.plant != "kinematic":
            raise ValueError(f"[kinematic] needs plant = \"kinematic\", not '{self.plant}'")
        return self

    @model_validator(mode="after")
    def _estimates_have_an_imu(self) -> Self:
        kinds = [sensor.kind for sensor in self.sensors]
        if "estimate" in kinds and "imu" not in kinds:
            raise ValueError('a sensor of kind "estimate" needs one of kind "imu"')
        return self

    @model_validator(mode="after")
    def _sensor_names_are_unique(self) -> Self:
        names = [s.name for s in self.sensors]
        names += [f"{s.name}_velocity" for s in self.sensors if s.kind == "gnss"]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"sensor names must differ; used twice: {', '.join(twice)}")
        for sensor in self.sensors:
            taken = sensor.name in _TAKEN_NAMES or sensor.name.startswith("laser")
            if sensor.kind not in _OWN_NAMES and taken:
                raise ValueError(
                    f"'{sensor.name}' is no name for a sensor of kind {sensor.kind}: names that "
                    f"begin with laser are reserved, and {', '.join(_TAKEN_NAMES)}"
                )
        return self


class UavGroup(Data):
    """One UAV, or `count` of them evenly spaced from `position_m` to `last_position_m`."""

    type: str
    count: Annotated[int, Field(ge=1, le=10_000)] = 1
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """x, y (on the ground) or x, y, z in the map."""
    last_position_m: Vector2 | None = None
    yaw_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    placement: Literal["exact", "nearest_free"] = "exact"
    """`nearest_free` searches around each position for one with free space to take off."""
    on_start: Literal["wait", "take_off"] = "wait"

    @model_validator(mode="after")
    def _many_need_a_line(self) -> Self:
        if self.count > 1 and self.last_position_m is None:
            raise ValueError("last_position_m is needed when count is larger than 1")
        return self


# --------------------------------------------------------------------------------------- the whole


class Physics(Data):
    """Physics step and effect of contacts."""

    rate_hz: Annotated[int, Field(ge=200, le=4000)] = 1000
    guidance_rate_hz: Annotated[int, Field(ge=25, le=1000)] = 125
    """Rate of flight modes and outer loop, in whole physics steps; attitude control runs at 250 Hz
    or at this rate, if higher."""
    on_contact: Literal["crash", "bounce"] = "crash"


class Scenario(Data):
    """A complete simulation, as data."""

    name: Name
    description: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    duration_s: Annotated[float, Field(gt=0.0, le=1_000_000.0)] = 60.0
    ends_when: Literal["time_is_up", "all_landed"] = "time_is_up"
    physics: Physics = Physics()
    world: World = World()
    radio: Radio | None = None
    types: Annotated[dict[Name, UavType], Field(min_length=1)]
    uavs: Annotated[tuple[UavGroup, ...], Field(min_length=1)]
    nodes: tuple[NodeEntry, ...] = ()
    """Nodes of the whole system, one of each; their relative names start at the root."""
    faults: tuple[Fault, ...] = ()
    message_packages: tuple[str, ...] = ()
    """Folders of ROS packages whose `.msg`, `.srv` and `.action` files the nodes use."""

    former_keys: ClassVar[Mapping[str, str]] = {"messages": "message_packages"}

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
        where = f"{self.name}: with_()"
        short, long = split_changes({**(changes or {}), **keys})
        changed = validated(with_keys(self.data(), long, where), Scenario, where)
        if short:
            data = with_short_forms(changed.data(), short, where)
            changed = validated(data, Scenario, where)
        return changed.with_access(self.access)

    def data(self) -> dict[str, Any]:
        """Returns the given keys as plain data: tables, lists, numbers, texts and dates."""
        return self.model_dump(exclude_unset=True)

    def to_toml(self) -> str:
        """Returns the given keys as TOML, which loads to an equal scenario.

        Raises `ScenarioError` if a node's parameter is something that TOML does not have.
        """
        return toml_text(self.model_dump(exclude_unset=True, exclude_none=True))

    def save(self, path: str | Path) -> None:
        """Writes a TOML file, which `load_scenario` loads to an equal scenario.

        Names of files in this scenario's folder become relative to the new file's folder. A saved
        scenario of a log or an upload has, when it is loaded, the access of its new owner. Raises
        `ScenarioError` if the file cannot be written.
        """
        path = Path(path)
        if path.suffix != ".toml":
            raise ScenarioError(f"{path}: a scenario is a .toml file; name it {path.name}.toml")
        data = self.model_dump(exclude_unset=True, exclude_none=True)
        text = toml_text(moved(data, self.access.folder, path.parent))
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise ScenarioError(f"{path}: cannot be written: {reason_of(error)}") from None

    @property
    def access(self) -> ScenarioAccess:
        """Access to files and code; see `load_scenario`."""
        return self._access

    def with_access(self, access: ScenarioAccess) -> Scenario:
        """Returns the same scenario with another access."""
        changed = self.model_copy()
        changed._access = access
        return changed

    @property
    def node_entries(self) -> tuple[NodeEntry, ...]:
        """All entries of nodes: those of UAV types, then those of the whole system."""
        return (*(entry for kind in self.types.values() for entry in kind.nodes), *self.nodes)

    @property
    def uav_count(self) -> int:
        """Number of UAVs in all groups."""
        return sum(group.count for group in self.uavs)
