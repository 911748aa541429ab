"""All that changes in an autopilot, as plain data: a snapshot keeps it as it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.mavlink.autopilot.modes import Mode
from volery.mavlink.autopilot.parameters import Value, defaults
from volery.mavlink.autopilot.plans import MissionItem
from volery.mavlink.autopilot.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.vehicle import FlightState, Vector

Source = tuple[int, int, int]
"""Who sent something: link, system, component."""


@dataclass
class LinkState:
    """One connection: its streams and who was heard on it."""

    number: int
    profile: int
    periods_ns: dict[int, int] = field(default_factory=dict)
    """Of its streams, by message id."""
    due: list[tuple[int, int]] = field(default_factory=list)
    """Instants (ns) and ids of what is to be sent, a heap."""
    sequence: int = 0
    parameters_to_send: list[int] = field(default_factory=list)
    """Indices, the next one last."""


@dataclass
class ManualInput:
    """The newest MANUAL_CONTROL: forward, right, up (each -1 to 1), turn to the right."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn: float = 0.0
    time_ns: int = -(1 << 62)


@dataclass
class Offboard:
    """Setpoints as they come, whether they are flown or not."""

    setpoint: OffboardSetpoint | None = None
    time_ns: int = -(1 << 62)
    begun_ns: int = -(1 << 62)
    """Since when they have come without a gap."""
    source: Source | None = None
    """Whose they are: others are not heard until that one falls silent."""
    refused: set[Source] = field(default_factory=set)
    """Others, who have been told so."""


@dataclass
class MissionTransfer:
    """A plan on its way, up or down."""

    kind: int
    source: Source
    upload: bool
    count: int
    items: list[MissionItem] = field(default_factory=list)
    time_ns: int = 0
    """Of the last sign of the other side."""
    asked_ns: int = 0
    retries: int = 0


@dataclass
class MissionLeg:
    """A way to a place, flown by velocities until it is near."""

    target: Vector
    yaw: float | None
    speed: float
    locked: bool = False
    """Whether the UAV was told the place itself."""


@dataclass
class Mission:
    """How far a mission is."""

    current: int = 0
    entered: bool = False
    """Whether the current item has been begun."""
    since_ns: int = 0
    """When the current item began to wait."""
    waiting: bool = False
    jumps_left: dict[int, int] = field(default_factory=dict)
    speed: float = math.nan
    """m/s that a DO_CHANGE_SPEED asked for."""
    interest: Vector | None = None
    """m, map: the place that a region of interest has it face."""
    reached: int = -1
    complete: bool = False


@dataclass
class Orbit:
    """A circle to fly on. center: m, map; radius: m, positive: clockwise; speed: m/s."""

    center: Vector
    radius: float
    speed: float
    facing: int
    """ORBIT_YAW_BEHAVIOUR."""
    initial_yaw: float
    """rad, map."""
    approaches: bool = True


@dataclass
class FollowTarget:
    """Estimate of what is followed: m, m/s, map, at a time."""

    position: Vector
    velocity: Vector
    time_ns: int
    course: float | None = None
    """rad, map; None: it has not moved yet."""


@dataclass
class Calibration:
    """A calibration under way; percent: the last one reported, -1: none."""

    sensor: str
    start_ns: int
    percent: int = -1


class ReturnState(NamedTuple):
    """Where a way home leads, and how far it has come."""

    goal: Vector
    phase: str
    since_ns: int


@dataclass
class AutopilotState:
    """The whole."""

    state: FlightState | None = None
    now_ns: int = 0
    mode: Mode = Mode.HOLD
    armed: bool = False
    armed_ns: int = 0
    airborne: bool = False
    """Whether it has left the ground since it was armed."""
    landed_ns: int = 0
    take_off_height: float = math.nan
    """m above the ground that the next take-off was asked for."""
    take_off_goal: Vector | None = None
    """m, map: where the present take-off from the ground ends."""
    order: str = ""
    """The last one to the UAV: what modes of its own may follow."""
    ordered_ns: int = 0
    sinks: float = math.nan
    """m/s at which the present landing was told to go down; nan: nothing was told."""
    target: OffboardSetpoint | None = None
    """What is flown, for who watches."""
    home: Vector | None = None
    chosen_home: Vector | None = None
    """Latitude and longitude in degrees and altitude of a home that somebody chose, as he did."""
    origin: Vector = (0.0, 0.0, 0.0)
    """m, map: where the local frame begins, the place at the start."""
    cruise: float = math.nan
    """m/s asked for by command; nan: the parameter's."""
    parameters: dict[str, Value] = field(default_factory=defaults)
    plans: dict[int, list[MissionItem]] = field(default_factory=lambda: {0: [], 1: [], 2: []})
    """By MAV_MISSION_TYPE: mission, fence, rally."""
    transfers: dict[int, MissionTransfer] = field(default_factory=dict)
    last_items: dict[int, tuple[Source, int]] = field(default_factory=dict)
    """By MAV_MISSION_TYPE: whose upload came through last, and the number of its last item."""
    mission: Mission = field(default_factory=Mission)
    leg: MissionLeg | None = None
    way_home: ReturnState | None = None
    sticks: ManualInput = field(default_factory=ManualInput)
    climb_thrust: float = 0.0
    """Altitude mode: what its integral has come to, share of the hover thrust."""
    altitude_target: float = math.nan
    offboard: Offboard = field(default_factory=Offboard)
    links: dict[int, LinkState] = field(default_factory=dict)
    ground_heard_ns: int = -1
    """When a ground station's heartbeat came last; -1: never."""
    fix_ns: int = 0
    """When satellites gave the last fix; of UAVs without a receiver it is always fresh."""
    has_receiver: bool = False
    """Whether satellite fixes come at all."""
    fix_lost: bool = False
    fix_denied: bool = False
    """Whether a UAV without a receiver has no fix: an injected failure."""
    failures: dict[tuple[int, int], dict[str, Any]] = field(default_factory=dict)
    """Injected faults of the simulation, by FAILURE_UNIT and instance."""
    orbit: Orbit | None = None
    followed: FollowTarget | None = None
    calibration: Calibration | None = None
    shells: dict[Source, str] = field(default_factory=dict)
    """Unfinished lines of the system shell."""
    pressure: float = math.nan
    """Pa, of the barometer; nan: there is none."""
    air_temperature: float = math.nan
    """degC, beside the pressure."""
    warned: set[str] = field(default_factory=set)
    """Failsafes that have been told of, and acted on."""
    failsafe: bool = False
    next_check_ns: int = 0
