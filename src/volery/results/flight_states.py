"""The states of a recorded flight: arrays of all UAVs, events, and the world below them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import FlightMode
from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.core.plurals import counted
from volery.engine.events import Event, EventKind

if TYPE_CHECKING:
    from volery.results.drawn_world import DrawnWorld

NO_MODE = -1
"""Number in `mode` of a UAV that did not exist at that time."""
CONTACTS = (EventKind.IMPACT, EventKind.COLLISION)


@dataclass(frozen=True, eq=False)
class UavFlight:
    """The flight of one UAV, T samples; nan where the UAV did not exist."""

    name: str
    """Name of the UAV."""
    times_s: Array
    """(T,) simulated time, s."""
    position_map: Array
    """(T, 3) m, map."""
    velocity_map: Array
    """(T, 3) m/s, map."""
    attitude: Array
    """(T, 4) quaternions x y z w, map from body."""
    omega_body: Array
    """(T, 3) rad/s, body (FLU)."""
    battery_charge: Array
    """(T,) remaining fraction of the capacity; 1 without a battery."""
    mode: NDArray[np.int8]
    """(T,) numbers of `FlightMode`; -1 where the UAV did not exist."""

    def __repr__(self) -> str:
        return f"UavFlight({self.name!r}: {counted(len(self.times_s), 'sample')})"


@dataclass(frozen=True, eq=False)
class FlightStates:
    """The flight of n UAVs, T samples of the true states; nan where a UAV did not exist."""

    scenario: str
    """Name of the scenario."""
    seed: int
    """Seed of the scenario, or of the last reset."""
    uavs: tuple[str, ...]
    """Names (n,)."""
    times_s: Array
    """(T,) simulated time, s."""
    position_map: Array
    """(n, T, 3) m, map."""
    velocity_map: Array
    """(n, T, 3) m/s, map."""
    attitude: Array
    """(n, T, 4) quaternions x y z w, map from body."""
    omega_body: Array
    """(n, T, 3) rad/s, body (FLU)."""
    battery_charge: Array
    """(n, T) remaining fraction of the capacity; 1 without a battery."""
    mode: NDArray[np.int8]
    """(n, T) numbers of `FlightMode`; -1 where the UAV did not exist."""
    events: tuple[Event, ...] = ()
    """Events of the recorded time, oldest first."""
    world: DrawnWorld | None = None
    """Ground, trees and solids for the map."""

    def __getitem__(self, name: str) -> UavFlight:
        """Returns the flight of one UAV. Raises `VoleryError` for an unknown name."""
        if name not in self.uavs:
            raise VoleryError(f"the flight has no UAV '{name}'; it has {', '.join(self.uavs)}")
        row = self.uavs.index(name)
        return UavFlight(
            name,
            self.times_s,
            self.position_map[row],
            self.velocity_map[row],
            self.attitude[row],
            self.omega_body[row],
            self.battery_charge[row],
            self.mode[row],
        )

    def __iter__(self) -> Iterator[str]:
        """Iterates over the names of the UAVs."""
        return iter(self.uavs)

    def __len__(self) -> int:
        """Returns the number of UAVs."""
        return len(self.uavs)

    def __repr__(self) -> str:
        return (
            f"FlightResult({self.scenario!r}, seed {self.seed}: {counted(len(self), 'UAV')}, "
            f"{counted(len(self.times_s), 'sample')}, {self.duration_s:g} s, "
            f"{counted(len(self.contacts), 'contact')})"
        )

    # ------------------------------------------------------------------------------------ numbers

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last one, s."""
        return float(self.times_s[-1] - self.times_s[0]) if len(self.times_s) else 0.0

    @cached_property
    def speed_m_s(self) -> Array:
        """Speeds (n, T), m/s."""
        return np.asarray(np.linalg.norm(self.velocity_map, axis=2), dtype=np.float64)

    @cached_property
    def distance_m(self) -> Array:
        """Lengths (n,) of the paths, m."""
        steps = np.linalg.norm(np.diff(self.position_map, axis=1), axis=2)
        return np.asarray(np.nansum(steps, axis=1), dtype=np.float64)

    @cached_property
    def contacts(self) -> tuple[Event, ...]:
        """Impacts on the ground, and collisions with trees, solids and UAVs, oldest first."""
        return tuple(event for event in self.events if event.kind in CONTACTS)

    @property
    def crashed(self) -> NDArray[np.bool_]:
        """For each UAV (n,), whether it crashed."""
        crashed: NDArray[np.bool_] = (self.mode == int(FlightMode.CRASHED)).any(axis=1)
        return crashed

    @cached_property
    def separation_m(self) -> Array:
        """Distances (T,), m, between the two UAVs that are nearest to each other; inf for one."""
        nearest = np.full(len(self.times_s), np.inf)
        for row in range(len(self) - 1):
            apart = np.linalg.norm(self.position_map[row + 1 :] - self.position_map[row], axis=2)
            nearest = np.minimum(nearest, np.where(np.isnan(apart), np.inf, apart).min(axis=0))
        return nearest

    def summary(self) -> dict[str, Any]:
        """Returns one row for the table of a study: numbers of the whole flight by name.

        `scenario`, `seed`, `uavs` (number), `duration_s`, `contacts` and `crashed` (numbers),
        `distance_m` and `max_speed_m_s` (mean and max over the UAVs), `min_separation_m` (nan for
        one UAV).
        """
        speeds = self.speed_m_s[np.isfinite(self.speed_m_s)]
        nearest_m = float(self.separation_m.min(initial=np.inf))
        return {
            "scenario": self.scenario,
            "seed": self.seed,
            "uavs": len(self),
            "duration_s": self.duration_s,
            "contacts": len(self.contacts),
            "crashed": int(self.crashed.sum()),
            "distance_m": float(self.distance_m.mean()) if len(self) else 0.0,
            "max_speed_m_s": float(speeds.max(initial=0.0)),
            "min_separation_m": nearest_m if np.isfinite(nearest_m) else np.nan,
        }
