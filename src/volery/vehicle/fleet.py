"""The state of a fleet: one row a UAV, in arrays that kernels, sensors and the engine share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.airframe import MAX_ROTORS

Array = NDArray[np.float64]

BODY = np.dtype(
    [
        ("position_map", "f8", 3),
        ("velocity_map", "f8", 3),
        ("attitude", "f8", 4),
        ("omega_body", "f8", 3),
        ("acceleration_map", "f8", 3),
        ("angular_acceleration_body", "f8", 3),
        ("free_acceleration", "f8", 3),
        ("free_angular_acceleration", "f8", 3),
        ("air_velocity_map", "f8", 3),
        ("contact_budget", "f8"),
        ("separation_budget", "f8"),
        ("ground_budget", "f8"),
        ("touch_speed", "f8"),
        ("last_contact_step", "i8"),
        ("still_steps", "i8"),
        ("crashed", "?"),
        ("on_ground", "?"),
        ("asleep", "?"),
        ("spare", "u1", 5),  # no hidden padding: equal states are equal bytes
        ("rotor_speed", "f8", MAX_ROTORS),
    ],
    align=True,
)
"""The plant's state of one UAV; `FleetState` explains the fields."""

NEVER = -(1 << 40)
"""A step long before the start."""


class FleetState(NamedTuple):
    """Views of the state, rows of UAVs; what is written here is what flies on.

    The rows lie one UAV after the other in memory, so the views are strided; use
    `np.ascontiguousarray` (or the rows of `Fleet.history`) where a kernel needs packed ones.
    """

    position_map: Array
    """(N, 3) m."""
    velocity_map: Array
    """(N, 3) m/s."""
    attitude: Array
    """(N, 4) unit quaternions, map from body."""
    omega_body: Array
    """(N, 3) rad/s, FLU."""
    acceleration_map: Array
    """(N, 3) m/s^2: dv/dt, the mean over the last step, contacts included; zero at rest."""
    angular_acceleration_body: Array
    """(N, 3) rad/s^2, FLU, the mean over the last step."""
    rotor_speed: Array
    """(N, MAX_ROTORS) rad/s; columns beyond a UAV's rotors stay zero."""
    crashed: NDArray[np.bool_]
    """(N,) rotors stopped for good."""
    on_ground: NDArray[np.bool_]
    """(N,) touched the terrain in the last step."""
    asleep: NDArray[np.bool_]
    """(N,) lies still on the ground with its rotors stopped and is not computed."""
    contact_budget: Array
    """(N,) m that may be flown before the clearance to solids must be looked up; inf: ever."""
    separation_budget: Array
    """(N,) m likewise, for the distance to other UAVs."""
    air_velocity_map: Array
    """(N, 3) m/s: velocity of the air at the UAV, refreshed at each guidance tick."""


def new_bodies(position_map: Array, attitude: Array) -> NDArray[np.void]:
    """Bodies (N,) at rest at `position_map` (N, 3) m, `attitude` (N, 4)."""
    bodies = np.zeros(len(position_map), BODY)
    bodies["position_map"] = position_map
    bodies["attitude"] = attitude
    bodies["contact_budget"] = np.inf
    bodies["separation_budget"] = np.inf
    bodies["last_contact_step"] = NEVER
    return bodies


def state_of(bodies: NDArray[np.void]) -> FleetState:
    """Views of `bodies` (N,)."""
    return FleetState(*(bodies[name] for name in FleetState._fields))
