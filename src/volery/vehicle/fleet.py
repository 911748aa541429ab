"""The state of a fleet: one row per UAV, in arrays that kernels, sensors and the engine share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.vehicle.airframe import MAX_ROTORS

BODY = np.dtype(
    [
        # fields that rarely change
        ("touch_speed", "f8"),
        ("last_contact_step", "i8"),
        ("still_steps", "i8"),
        ("battery_charge", "f8"),
        ("battery_pair_voltage", "f8"),  # V lost over the battery's RC pair
        ("battery_voltage", "f8"),
        ("battery_current", "f8"),
        ("battery_level", "i8"),
        ("rotor_angle", "f8", MAX_ROTORS),  # turned so far, at the end of the guidance tick
        ("rotor_health", "f8", MAX_ROTORS),
        (
            "rotor_lift",
            "f8",
            MAX_ROTORS,
        ),  # N s^2: thrust over speed squared, wear and ground included
        (
            "free_acceleration",
            "f8",
            3,
        ),  # on the ground: acceleration_map without contact ...
        ("free_angular_acceleration", "f8", 3),  # ... and the angular one
        # fields of every step, adjacent for the cache
        ("rotor_speed", "f8", MAX_ROTORS),
        ("position_map", "f8", 3),
        ("velocity_map", "f8", 3),
        ("attitude", "f8", 4),
        ("omega_body", "f8", 3),
        ("air_velocity_map", "f8", 3),
        ("acceleration_map", "f8", 3),
        ("angular_acceleration_body", "f8", 3),
        ("contact_budget", "f8"),
        ("separation_budget", "f8"),
        ("ground_budget", "f8"),
        ("downwash_budget", "f8"),  # m until it may meet another's jet, vehicle.downwash
        ("crashed", "?"),
        ("on_ground", "?"),
        ("asleep", "?"),
        ("altered", "?"),  # some rotor_lift is not that of a new rotor far from the ground
        ("in_jet", "?"),  # another's jet may reach it, vehicle.downwash
        ("spare", "u1", 3),  # no hidden padding: equal states are equal bytes
    ],
    align=True,
)
"""State of one UAV's plant; `FleetState` explains the fields."""

NEVER = -(1 << 40)
"""A step long before the start."""


class FleetState(NamedTuple):
    """Writable views of the state, rows of N UAVs; writing changes the simulation.

    The rows are one UAV after the other in memory, so the views are strided; use
    `np.ascontiguousarray` (or the rows of `Fleet.history`) where a kernel needs contiguous ones.
    """

    position_map: Array
    """(N, 3) m, map frame."""
    velocity_map: Array
    """(N, 3) m/s, map frame."""
    attitude: Array
    """(N, 4) unit quaternions, map from body."""
    omega_body: Array
    """(N, 3) rad/s, FLU."""
    air_velocity_map: Array
    """(N, 3) m/s, map frame, of the air around each UAV: wind and downwash, of the last guidance
    tick."""
    acceleration_map: Array
    """(N, 3) m/s^2, map frame: dv/dt, mean of the last step, contacts included; zero at rest."""
    angular_acceleration_body: Array
    """(N, 3) rad/s^2, FLU, mean of the last step."""
    rotor_speed: Array
    """(N, MAX_ROTORS) rad/s; columns beyond a UAV's rotors are zero."""
    rotor_angle: Array
    """(N, MAX_ROTORS) rad turned by each rotor, unsigned; see `RotorTurns`."""
    rotor_health: Array
    """(N, MAX_ROTORS) fraction of the new rotor's thrust; 0: failed and stopped; zero beyond a
    UAV's rotors. `Fleet.set_rotor_health` changes it."""
    battery_charge: Array
    """(N,) remaining fraction of the capacity; 1 without a battery."""
    battery_voltage: Array
    """(N,) V under the present load; 0 without a battery."""
    battery_current: Array
    """(N,) A drawn; 0 without a battery."""
    battery_level: NDArray[np.int64]
    """(N,) `vehicle.battery.BatteryLevel`."""
    crashed: NDArray[np.bool_]
    """(N,) whether the rotors are stopped for good."""
    on_ground: NDArray[np.bool_]
    """(N,) whether the UAV touched the terrain in the last step."""
    asleep: NDArray[np.bool_]
    """(N,) whether the UAV rests on the ground with stopped rotors and is not computed."""
    contact_budget: Array
    """(N,) m to fly before the clearance to solids must be computed again; inf: never."""
    separation_budget: Array
    """(N,) m to fly before the distance to other UAVs must be computed again; inf: never."""


class RotorTurns(NamedTuple):
    """Angles and speeds of the rotors at a time."""

    angle: Array
    """(N, MAX_ROTORS) rad at `time_ns`, unsigned."""
    speed: Array
    """(N, MAX_ROTORS) rad/s."""
    time_ns: int

    def at(self, time_ns: int) -> Array:
        """Returns angles (N, MAX_ROTORS), rad, at a nearby time, at constant speed."""
        return self.angle + self.speed * (1e-9 * (time_ns - self.time_ns))


def new_bodies(position_map: Array, attitude: Array) -> NDArray[np.void]:
    """Returns bodies (N,) at rest at `position_map` (N, 3) m, `attitude` (N, 4) map from body."""
    bodies = np.zeros(len(position_map), BODY)
    bodies["position_map"] = position_map
    bodies["attitude"] = attitude
    bodies["contact_budget"] = np.inf
    bodies["separation_budget"] = np.inf
    bodies["last_contact_step"] = NEVER
    return bodies


def fit_rotors(body: np.void, plant: np.void, health: ArrayLike) -> None:
    """Sets the rotor health (R,) of a `BODY` record with its `PLANT`."""
    count = int(plant["rotors"])
    body["rotor_health"][:count] = health
    body["rotor_lift"][:count] = plant["thrust_constant"] * np.asarray(health)
    body["altered"] = (np.asarray(health) != 1.0).any()


def charge_battery(body: np.void, plant: np.void, charge: float) -> None:
    """Sets a `BODY` record's battery of its `PLANT` to a `charge` from 0 to 1, without load."""
    battery = plant["battery"]
    body["battery_charge"] = charge
    body["battery_pair_voltage"] = body["battery_current"] = 0.0
    body["battery_level"] = 0
    table = battery["open_circuit"]
    body["battery_voltage"] = np.interp(charge, np.linspace(0.0, 1.0, len(table)), table)


def state_of(bodies: NDArray[np.void]) -> FleetState:
    """Returns views of `bodies` (N,)."""
    return FleetState(*(bodies[name] for name in FleetState._fields))
