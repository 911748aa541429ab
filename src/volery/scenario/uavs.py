"""The UAVs of a scenario: types with sensors and nodes, and groups of UAVs."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from volery.scenario.base import Data, Vector2
from volery.scenario.node_names import NODE_PATTERN, name_of_class
from volery.scenario.sensors import Sensor

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
    """Minimum height above the take-off position on the way home."""
    command_timeout_s: Annotated[float, Field(ge=0.05, le=60.0)] = 0.5
    """Time without a velocity command after which the UAV holds its position."""
    low_battery_action: Literal["warn", "land", "return"] = "warn"
    """As PX4's COM_LOW_BAT_ACT: warn; land at the critical level; return home at the critical level
    and land at the emergency level."""


class NodeEntry(Data):
    """A node that runs inside the simulation, in lock step: for one UAV, or for all of them."""

    node: Annotated[str, Field(pattern=NODE_PATTERN)]
    """A registered name, such as `slam`, or `module:Class`; in Python also a class of its own."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Parameters of the node by name."""
    latency_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Simulated time from a callback's input to its output; above 0 the node runs on a worker."""

    @field_validator("node", mode="before")
    @classmethod
    def _name_the_class(cls, node: Any) -> Any:
        return name_of_class(node) if isinstance(node, type) else node


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
    """Shipped airframe, or path of a .toml file."""
    plant: Literal["rigid_body", "identified", "kinematic"] = "rigid_body"
    """Model of motion; the airframe defines size and limits for all of them."""
    identified_model: str | None = None
    """Model of an identified plant: a shipped name or a .toml path; None: the airframe's name."""
    kinematic: KinematicMotion = KinematicMotion()
    """Response of a kinematic plant to velocity commands."""
    wear: tuple[RotorWear, ...] = ()
    """One entry per rotor, in the order of the airframe; empty: all are new."""
    battery_charge: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Fraction of the capacity at the start, if the airframe has a battery."""
    flight: Flight = Flight()
    """Parameters of the flight modes."""
    sensors: tuple[Sensor, ...] = ()
    """Sensors of each UAV; their names differ."""
    nodes: tuple[NodeEntry, ...] = ()
    """Nodes that run for each UAV, in its namespace."""
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
    """Type of the UAVs, a name of `types`."""
    count: Annotated[int, Field(ge=1, le=10_000)] = 1
    """Number of UAVs."""
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """x, y (on the ground) or x, y, z in the map."""
    last_position_m: Vector2 | None = None
    """Position x, y of the last UAV in the map; needed when count is larger than 1."""
    yaw_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Initial heading, counter-clockwise from x of the map."""
    placement: Literal["exact", "nearest_free"] = "exact"
    """`nearest_free` searches around each position for one with free space to take off."""
    on_start: Literal["wait", "take_off"] = "wait"
    """Behaviour at the start: the UAV waits for commands, or takes off."""

    @model_validator(mode="after")
    def _many_need_a_line(self) -> Self:
        if self.count > 1 and self.last_position_m is None:
            raise ValueError("last_position_m is needed when count is larger than 1")
        return self
