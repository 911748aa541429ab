"""What the autopilot knows of its UAV, and what it can ask of it. ENU, FLU, SI, rad."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class FlightState(NamedTuple):
    """How a UAV stands at a simulated time, as its controllers know it."""

    time_ns: int
    mode: str
    """Of the UAV: LANDED, TAKE_OFF, HOLD, GO_TO, VELOCITY, LAND, RETURN, LOW_LEVEL, CRASHED,
    TRAJECTORY."""
    airborne: bool
    crashed: bool
    position: Vector
    """m, map."""
    attitude: Quaternion
    """x y z w, map from body."""
    velocity: Vector
    rates: Vector
    """rad/s, body."""
    acceleration: Vector
    """m/s^2, map."""
    charge: float
    """0 to 1; nan: no battery."""
    voltage: float
    current: float
    rotors: tuple[float, ...]
    """Share of full speed."""


@dataclass(frozen=True)
class VehicleInfo:
    """What of a UAV never changes."""

    airframe: str
    rotors: int
    hover_thrust: float
    """Share of the full thrust that carries it."""
    speed: float
    """Limits, m/s and rad."""
    climb: float
    descent: float
    tilt: float
    battery_cells: int
    battery_capacity_ah: float
    origin: Vector
    """The map's: latitude and longitude in degrees, altitude in m."""


class Vehicle(Protocol):
    """A UAV that does as it is told; what comes back is why it does not, empty where it does."""

    def take_off(self, height_m: float) -> str:
        """From the ground, straight up."""

    def hold(self) -> str:
        """Brake, and keep the place."""

    def land(self) -> str:
        """Straight down, until the rotors stop."""

    def sink(self, speed: float) -> str:
        """How fast the present landing goes down."""

    def stop(self) -> str:
        """Rotors off at once: it falls."""

    def go_to(self, position: Vector, yaw: float | None) -> str:
        """Fly to a place and stay there."""

    def steer(self, velocity: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Fly with a velocity, facing yaw, or turning where that is None."""

    def follow(
        self,
        position: Vector,
        velocity: Vector,
        acceleration: Vector,
        yaw: float | None,
        yaw_rate: float,
    ) -> None:
        """Be at a place with a motion: a point of a trajectory."""

    def push(self, acceleration: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Accelerate."""

    def tilt(self, attitude: Quaternion, thrust: float) -> None:
        """Hold an attitude, with a share of the full thrust."""

    def fail(self, fault: dict[str, Any]) -> str:
        """Injects a fault of the simulation, without its `uav`."""

    def end_fault(self, fault: dict[str, Any]) -> str:
        """Ends a fault that was injected."""

    def spin(self, rates: Vector, thrust: float) -> None:
        """Hold body rates, with a share of the full thrust."""
