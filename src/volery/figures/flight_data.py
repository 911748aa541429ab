"""Plain data of a flight for the figures and the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S


@dataclass(frozen=True)
class UavTrack:
    """Ground truth of one UAV, n samples."""

    name: str
    time_s: Array
    """(n,)"""
    position_map: Array
    """(n, 3) m"""
    speed_m_s: Array
    """(n,)"""
    height_m: Array
    """(n,) above the ground below."""
    clearance_m: Array
    """(n,) to the nearest tree or solid; inf beyond the searched range."""

    @property
    def distance_m(self) -> float:
        """Length of the path, m."""
        return float(np.linalg.norm(np.diff(self.position_map, axis=0), axis=1).sum())

    @property
    def minimum_clearance_m(self) -> float:
        """Min clearance, m; inf if nothing came within range."""
        return float(self.clearance_m.min(initial=np.inf))


@dataclass(frozen=True)
class Ground:
    """Heightfield: heights (rows along y, columns along x) m, lower left corner, spacing."""

    heights: Array
    origin: tuple[float, float]
    spacing_m: float

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in the map, m."""
        rows, columns = self.heights.shape
        x0, y0 = self.origin
        return x0, y0, x0 + (columns - 1) * self.spacing_m, y0 + (rows - 1) * self.spacing_m


@dataclass(frozen=True)
class Trees:
    """The forest as seen from above, N trees."""

    position_map: Array
    """(N, 3) foot, m"""
    crown_radius_m: Array
    """(N,) m."""
    dbh_m: Array
    """(N,) m, trunk diameter at breast height."""


@dataclass(frozen=True)
class Structures:
    """Buildings and other solids as seen from above."""

    tops: Array
    """(K, 3, 2) triangles that look up, m"""
    edges: Array
    """(E, 2, 2) lines around them, m"""


@dataclass(frozen=True)
class LidarMap:
    """Map of LIDAR returns, one point per voxel, M points."""

    points_map: NDArray[np.float32]
    """(M, 3) m"""
    height_m: NDArray[np.float32]
    """(M,) above the ground below"""
    voxel_m: float
    scans: int
    """Number of scans in it."""


@dataclass(frozen=True)
class FlightEvent:
    """An event of the flight, such as a contact or a landing."""

    time_s: float
    kind: str
    text: str
    position_map: tuple[float, float, float] | None = None

    @property
    def is_contact(self) -> bool:
        """Whether a UAV hit an obstacle or another UAV."""
        return self.kind in {"impact", "collision"}


def drawn_event(event: Any) -> FlightEvent:
    """Returns an event of the engine as drawn in figures."""
    x, y, z = (float(v) for v in event.position_map)
    kind = str(getattr(event.kind, "value", event.kind))
    return FlightEvent(event.time_ns / NS_PER_S, kind, event.describe(), (x, y, z))


@dataclass(frozen=True)
class FlightData:
    """All data of one flight."""

    scenario: str
    description: str
    seed: int
    simulated_s: float
    planned_s: float
    wall_s: float
    uavs: tuple[UavTrack, ...]
    ground: Ground
    trees: Trees | None = None
    structures: Structures | None = None
    lidar: LidarMap | None = None
    events: tuple[FlightEvent, ...] = ()
    stage_seconds: Mapping[str, float] = field(default_factory=dict)
    """Wall seconds spent in each stage of the engine."""
    max_clearance_m: float = 10.0
    digest: str = ""
    interrupted: str = ""
    """Why the flight ended early; empty if it did not."""
    log_path: Path | None = None
    log_messages: int = 0
    machine: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per wall second."""
        return self.simulated_s / self.wall_s if self.wall_s > 0.0 else 0.0

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return sum(event.is_contact for event in self.events)
