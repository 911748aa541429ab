"""The state of an autopilot as plain data, which a snapshot saves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.parameters import Value, defaults
from volery.mavlink.autopilot.protocols.plans import MissionItem
from volery.mavlink.autopilot.vehicle import FlightState, Vector

Source = tuple[int, int, int]
"""Sender of a message: link, system, component."""


@dataclass
class ManualInput:
    """Newest MANUAL_CONTROL: forward, right, up (each -1 to 1), turn to the right."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn: float = 0.0
    time_ns: int = -(1 << 62)
    source: Source | None = None
    """Sender; others are ignored until this one is silent."""


@dataclass
class Offboard:
    """Received setpoints, flown or not."""

    setpoint: OffboardSetpoint | None = None
    time_ns: int = -(1 << 62)
    source: Source | None = None
    """Sender; others are ignored until this one is silent."""
    refused: set[Source] = field(default_factory=set)
    """Other senders that have been notified."""


@dataclass
class MissionTransfer:
    """A plan in transfer, up or down."""

    kind: int
    source: Source
    upload: bool
    count: int
    items: list[MissionItem] = field(default_factory=list)
    time_ns: int = 0
    """Time of the last message of the other side."""
    requested_ns: int = 0
    retries: int = 0
    first: int = 0
    """Item marked as the current one, with which the mission starts."""


@dataclass
class MissionLeg:
    """A leg to a position, flown by velocities until the UAV is near."""

    target: Vector
    yaw: float | None
    speed: float
    locked: bool = False
    """Whether the position itself was commanded."""


@dataclass
class Mission:
    """Progress of a mission."""

    current: int = 0
    entered: bool = False
    """Whether the current item has started."""
    since_ns: int = 0
    """Time at which the current item began to wait."""
    waiting: bool = False
    jumps_left: dict[int, int] = field(default_factory=dict)
    speed: float = math.nan
    """Speed of a DO_CHANGE_SPEED, m/s."""
    interest: Vector | None = None
    """Position of the region of interest to face, m, map."""
    turn: tuple[float, float] = (0.0, 0.0)
    """Yaw at the start of a turn on the spot, and by how much it turns, rad, map."""
    stays: bool = False
    """Whether the current item is done, and no other one follows by itself."""
    reached: int = -1
    complete: bool = False


@dataclass
class Orbit:
    """Circle to fly on. center: m, map; radius: m, positive: clockwise; speed: m/s."""

    center: Vector
    radius: float
    speed: float
    facing: int
    """Value of ORBIT_YAW_BEHAVIOUR."""
    initial_yaw: float
    """Yaw at the start, rad, map."""
    approaches: bool = True


@dataclass
class FollowTarget:
    """Estimate of the followed target: m, m/s, map, at a time."""

    position: Vector
    velocity: Vector
    time_ns: int
    course: float | None = None
    """Course, rad, map; None: the target has not moved yet."""


@dataclass
class Calibration:
    """A calibration in progress; percent: the last one reported, -1: none."""

    sensor: str
    start_ns: int
    percent: int = -1


class ReturnState(NamedTuple):
    """Goal and progress of a return."""

    goal: Vector
    phase: str
    since_ns: int


@dataclass
class AutopilotState:
    """State of an autopilot."""

    state: FlightState | None = None
    now_ns: int = 0
    mode: Mode = Mode.HOLD
    armed: bool = False
    armed_ns: int = 0
    airborne: bool = False
    """Whether the UAV has left the ground since arming."""
    landed_ns: int = 0
    take_off_height: float = math.nan
    """Requested height above the ground of the next take-off, m."""
    take_off_position: tuple[float, float] | None = None
    """Requested position of the next take-off, m, map, to which the UAV flies after its climb."""
    take_off_goal: Vector | None = None
    """Goal of the current take-off from the ground, m, map."""
    order: str = ""
    """Last command to the UAV; it determines which of the UAV's modes may follow."""
    ordered_ns: int = 0
    sinks: float = math.nan
    """Commanded descent speed of the current landing, m/s; nan: none."""
    target: OffboardSetpoint | None = None
    """Current target, for telemetry."""
    home: Vector | None = None
    chosen_home: Vector | None = None
    """Latitude, longitude, degrees, and altitude, m, of a home that a client chose."""
    home_yaw: float = math.nan
    """Yaw of a home that a client chose, rad, map; nan: free."""
    origin: Vector = (0.0, 0.0, 0.0)
    """Origin of the local frame, m, map: the position at the start."""
    cruise: float = math.nan
    """Speed set by command, m/s; nan: the parameter's."""
    parameters: dict[str, Value] = field(default_factory=defaults)
    plans: dict[int, list[MissionItem]] = field(default_factory=lambda: {0: [], 1: [], 2: []})
    """Items by MAV_MISSION_TYPE: mission, fence, rally."""
    transfers: dict[int, MissionTransfer] = field(default_factory=dict)
    last_items: dict[int, tuple[Source, int]] = field(default_factory=dict)
    """Sender of the last complete upload and the number of its last item, by MAV_MISSION_TYPE."""
    mission: Mission = field(default_factory=Mission)
    leg: MissionLeg | None = None
    return_state: ReturnState | None = None
    sticks: ManualInput = field(default_factory=ManualInput)
    climb_thrust: float = 0.0
    """Integral of the altitude mode, as a fraction of the hover thrust."""
    altitude_target: float = math.nan
    offboard: Offboard = field(default_factory=Offboard)
    ground_heartbeat_ns: int = -1
    """Time of the last heartbeat of a ground station; -1: never."""
    fix_ns: int = 0
    """Time of the last satellite fix; always current for UAVs without a receiver."""
    has_receiver: bool = False
    """Whether satellite fixes arrive at all."""
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
    """Pressure of the barometer, Pa; nan: no barometer."""
    air_temperature: float = math.nan
    """Air temperature with the pressure, degC."""
    warned: set[str] = field(default_factory=set)
    """Failsafes that have been reported and handled."""
    failsafe: bool = False
    next_check_ns: int = 0
    text_number: int = 0
    """Number of the last STATUSTEXT, 1 to 65535."""
    refused_messages: set[str] = field(default_factory=set)
    """Unsupported messages that have been reported to their client."""
    reported_refusals: dict[str, int] = field(default_factory=dict)
    """Refusals of messages without an answer, and when they were reported."""

    @property
    def home_or_origin(self) -> Vector:
        """Home, m, map; the local frame's origin until there is a home."""
        return self.home or self.origin
