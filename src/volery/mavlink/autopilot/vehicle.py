"""The autopilot's interface to its UAV: state, properties and commands. ENU, FLU, SI, rad."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class FlightState(NamedTuple):
    """State of a UAV at a simulated time, as its controllers estimate it."""

    time_ns: int
    mode: str
    """Mode of the UAV: LANDED, TAKE_OFF, HOLD, GO_TO, VELOCITY, LAND, RETURN, LOW_LEVEL, CRASHED,
    TRAJECTORY."""
    airborne: bool
    crashed: bool
    position: Vector
    """Position, m, map."""
    attitude: Quaternion
    """Quaternion x y z w, map from body."""
    velocity: Vector
    rates: Vector
    """Body rates, rad/s, body."""
    acceleration: Vector
    """Acceleration, m/s^2, map."""
    charge: float
    """State of charge, 0 to 1; nan: no battery."""
    voltage: float
    current: float
    rotors: tuple[float, ...]
    """Fractions of full speed."""


@dataclass(frozen=True)
class VehicleInfo:
    """Constant properties of a UAV."""

    airframe: str
    rotors: int
    hover_thrust: float
    """Fraction of the full thrust in hover."""
    speed: float
    """Limits of speed, climb, descent, m/s, and tilt, rad."""
    climb: float
    descent: float
    tilt: float
    battery_cells: int
    battery_capacity_ah: float
    origin: Vector
    """Origin of the map: latitude and longitude in degrees, altitude in m."""


class Vehicle(Protocol):
    """Commands of a UAV; methods return why a command was refused, empty if accepted."""

    def take_off(self, height_m: float) -> str:
        """Takes off from the ground, straight up, to `height_m`."""

    def hold(self) -> str:
        """Brakes and holds the position."""

    def land(self) -> str:
        """Lands straight down and stops the rotors."""

    def sink(self, speed: float) -> str:
        """Sets the descent speed of the current landing, m/s."""

    def stop(self) -> str:
        """Stops the rotors at once; the UAV falls."""

    def go_to(self, position: Vector, yaw: float | None) -> str:
        """Flies to a position, m, map, and holds there."""

    def steer(self, velocity: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Flies with a velocity, m/s, map, at `yaw`, or at `yaw_rate` if yaw is None."""

    def follow(
        self,
        position: Vector,
        velocity: Vector,
        acceleration: Vector,
        yaw: float | None,
        yaw_rate: float,
    ) -> None:
        """Follows a point of a trajectory: position, velocity and acceleration, map."""

    def push(self, acceleration: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Accelerates, m/s^2, map."""

    def tilt(self, attitude: Quaternion, thrust: float) -> None:
        """Holds an attitude, map from body, with a fraction of the full thrust."""

    def fail(self, fault: dict[str, Any]) -> str:
        """Injects a fault of the simulation, given without its `uav`."""

    def end_fault(self, fault: dict[str, Any]) -> str:
        """Ends an injected fault."""

    def spin(self, rates: Vector, thrust: float) -> None:
        """Holds body rates, rad/s, with a fraction of the full thrust."""
