"""Beam patterns of scanners: planar, rings, rosette, or a user-defined table.

Beams are numbered in the order of the messages. Angles are those of the sensor frame (FLU): azimuth
counter-clockwise about z from x, elevation up from the x-y plane.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, PrivateAttr, model_validator

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import DataFileError
from volery.scenario.access import ScenarioAccess
from volery.sensors.lidar.beam_file import BeamList, read_beams
from volery.sensors.lidar.beam_table import BeamTable, block_table, row_table
from volery.sensors.lidar.pattern import MAX_BEAMS, Pattern, median_spacing
from volery.world.embree import LANES

Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]
_TILE_COLUMNS = 4
"""Columns of a packet of a ring scanner; LANES / 4 neighbouring rings fill it."""


class PlanarScan(Pattern):
    """Evenly spaced beams in the sensor's x-y plane."""

    kind: Literal["planar"]
    beams: Annotated[int, Field(ge=2, le=MAX_BEAMS)]
    angle_min_rad: float
    angle_max_rad: float
    sweep_duration_s: PositiveFloat
    """Time from the first beam to the last; the rest of a turn is blind."""

    @model_validator(mode="after")
    def _is_one_turn(self) -> Self:
        if not self.angle_max_rad > self.angle_min_rad:
            raise ValueError("angle_max_rad must exceed angle_min_rad")
        if self.sweep_duration_s > 1.0 / self.rate_hz:
            raise ValueError("sweep_duration_s must fit in one turn of 1 / rate_hz")
        return self

    @property
    def angle_increment_rad(self) -> float:
        """Angle from a beam to the next, rad."""
        return (self.angle_max_rad - self.angle_min_rad) / (self.beams - 1)

    @property
    def time_increment_s(self) -> float:
        """Time from a beam to the next, s."""
        return self.sweep_duration_s / (self.beams - 1)

    @property
    def spacing_rad(self) -> float:
        """Angle from a beam to the next."""
        return self.angle_increment_rad

    @cached_property
    def angles(self) -> Array:
        """(beams,) azimuth of each beam, rad."""
        return np.linspace(self.angle_min_rad, self.angle_max_rad, self.beams)

    @cached_property
    def time_ns(self) -> NDArray[np.int64]:
        """(beams,) ns, evenly spaced over the sweep."""
        duration = ns_from_s(self.sweep_duration_s)
        return (duration * np.arange(self.beams) / (self.beams - 1)).astype(np.int64)

    def _aim(self, sweep: int) -> Array:  # noqa: ARG002 - all sweeps are alike
        """Returns directions (3, beams)."""
        return np.stack([np.cos(self.angles), np.sin(self.angles), np.zeros(self.beams)])

    @cached_property
    def _first_table(self) -> BeamTable:
        return row_table(self.directions(0), self.time_ns)


class RingScan(Pattern):
    """A spinning head with one laser per ring; a column is one firing of all lasers.

    Beams are numbered column by column, within a column by ring. Laser r of column c fires at `c
    column_period_s + firing_offset_s[r]`; its azimuth is that of the head at that time plus
    `azimuth_offset_deg[r]`.
    """

    kind: Literal["rings"]
    columns: Annotated[int, Field(ge=2, le=MAX_BEAMS)]
    column_period_s: PositiveFloat
    azimuth_start_deg: Degrees = 0.0
    """Azimuth of the head at the first column."""
    azimuth_step_deg: Degrees
    """Angle from a column to the next; negative turns clockwise, seen from above."""
    elevation_deg: Annotated[
        tuple[Annotated[float, Field(ge=-90.0, le=90.0)], ...],
        Field(min_length=1, max_length=1024),
    ]
    """Elevation of each laser, in the order of the rings' numbers."""
    azimuth_offset_deg: tuple[Degrees, ...] = ()
    """Offset of each laser; empty: none."""
    firing_offset_s: tuple[NonNegativeFloat, ...] = ()
    """Offset of each laser; empty: all fire at once."""

    @model_validator(mode="after")
    def _is_one_turn(self) -> Self:
        rings = len(self.elevation_deg)
        for name in ("azimuth_offset_deg", "firing_offset_s"):
            if len(getattr(self, name)) not in {0, rings}:
                raise ValueError(f"{name} must have one entry per ring ({rings}), or none")
        if rings * self.columns > MAX_BEAMS:
            raise ValueError(f"rings times columns must be at most {MAX_BEAMS}")
        if self.azimuth_step_deg == 0.0:
            raise ValueError("azimuth_step_deg must not be 0")
        if self.sweep_ns > NS_PER_S / self.rate_hz:
            raise ValueError("columns times column_period_s must fit in one turn of 1 / rate_hz")
        return self

    @property
    def stride(self) -> int:
        """Number of rings: the next beam of a ring is one column later."""
        return len(self.elevation_deg)

    @property
    def spacing_rad(self) -> float:
        """Angle from a column to the next."""
        return math.radians(abs(self.azimuth_step_deg))

    @cached_property
    def ring(self) -> NDArray[np.uint16]:
        """(beams,) see `Pattern`."""
        return np.tile(np.arange(self.stride, dtype=np.uint16), self.columns)

    @cached_property
    def time_ns(self) -> NDArray[np.int64]:
        """(beams,) see `Pattern`."""
        seconds = np.arange(self.columns)[:, None] * self.column_period_s + self._firing_offset
        return np.round(seconds * NS_PER_S).astype(np.int64).reshape(-1)

    def _aim(self, sweep: int) -> Array:  # noqa: ARG002 - all sweeps are alike
        """Returns directions (3, beams)."""
        column = np.arange(self.columns)[:, None] + self._firing_offset / self.column_period_s
        offset = np.array(self.azimuth_offset_deg or [0.0] * self.stride)
        azimuth = np.radians(self.azimuth_start_deg + self.azimuth_step_deg * column + offset)
        elevation = np.broadcast_to(np.radians(self.elevation_deg), azimuth.shape)
        level = np.cos(elevation)
        unit = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        return np.stack(unit).reshape(3, -1)

    @property
    def _firing_offset(self) -> Array:
        return np.array(self.firing_offset_s or [0.0] * self.stride)

    @cached_property
    def _first_table(self) -> BeamTable:
        """Table whose packets are tiles of neighbouring columns and rings."""
        column, ring = np.divmod(np.arange(self.columns * self.stride), self.stride)
        rank = np.argsort(np.argsort(self.elevation_deg, kind="stable"))[ring]
        tile, rows = column // _TILE_COLUMNS, LANES // _TILE_COLUMNS
        order = np.lexsort([rank % rows, column, rank // rows, tile])
        return block_table(self.directions(0), self.time_ns, order, tile)


class RosetteScan(Pattern):
    """One beam deflected by two turning prisms; the pattern continues from sweep to sweep.

    Each prism deflects the beam by `deflection_deg` towards its own direction, which turns at
    `prism_rpm` in the sensor's y-z plane; small angles add up as vectors.
    """

    kind: Literal["rosette"]
    points: Annotated[int, Field(ge=2, le=MAX_BEAMS)]
    point_period_s: PositiveFloat
    prism_rpm: tuple[float, float]
    """Speed of each prism; positive turns from y to z."""
    deflection_deg: tuple[
        Annotated[float, Field(gt=0.0, le=45.0)], Annotated[float, Field(gt=0.0, le=45.0)]
    ]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.sweep_ns > NS_PER_S / self.rate_hz:
            raise ValueError("points times point_period_s must fit in 1 / rate_hz")
        return self

    @property
    def is_fixed(self) -> bool:
        """False: the prisms do not return to their start angles after a sweep."""
        return False

    @cached_property
    def spacing_rad(self) -> float:
        """Median angle from a point to the next."""
        return median_spacing(self.directions(0))

    @cached_property
    def time_ns(self) -> NDArray[np.int64]:
        """(points,) ns after the start of the sweep."""
        return np.round(np.arange(self.points) * self.point_period_s * NS_PER_S).astype(np.int64)

    def _aim(self, sweep: int) -> Array:
        """Returns directions (3, points)."""
        start_s = sweep / self.rate_hz
        bent = np.zeros(self.points, dtype=np.complex128)
        for path, rpm in zip(self._paths, self.prism_rpm, strict=True):
            turn = math.fmod(rpm / 60.0 * start_s, 1.0)
            bent += path * complex(math.cos(math.tau * turn), math.sin(math.tau * turn))
        off_axis = np.abs(bent)
        across = np.sinc(off_axis / np.pi) * bent
        return np.stack([np.cos(off_axis), across.real, across.imag])

    @cached_property
    def _paths(self) -> tuple[NDArray[np.complex128], ...]:
        """Deflection by each prism in the first sweep, y + i z, rad."""
        return tuple(
            math.radians(angle) * np.exp(1j * math.tau * (rpm / 60.0) * self.time_ns / NS_PER_S)
            for angle, rpm in zip(self.deflection_deg, self.prism_rpm, strict=True)
        )


class TableScan(Pattern):
    """Beams listed in a CSV file `azimuth_deg,elevation_deg,time_s[,ring]`, in order of time."""

    kind: Literal["table"]
    file: str
    """Path in the folder of the model file, or below it."""

    _folder: Path = PrivateAttr(default=Path())

    @cached_property
    def _list(self) -> BeamList:
        access = ScenarioAccess(self._folder, is_confined=True)
        try:
            path = access.find_file(self.file, shipped=None)
        except DataFileError:
            raise DataFileError(
                f"{self._folder / self.file}: cannot be read; a beam table lies in the folder of "
                "its model file or below it"
            ) from None
        return read_beams(path, 1.0 / self.rate_hz, MAX_BEAMS)

    @cached_property
    def spacing_rad(self) -> float:
        """Median angle from a beam to the next."""
        return median_spacing(self.directions(0))

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """(beams,) see `Pattern`."""
        return self._list.time_ns

    @property
    def ring(self) -> NDArray[np.uint16]:
        """(beams,) see `Pattern`."""
        return self._list.ring

    def _aim(self, sweep: int) -> Array:  # noqa: ARG002 - all sweeps are alike
        """Returns directions (3, beams)."""
        return self._list.direction


ScanPattern = Annotated[
    PlanarScan | RingScan | RosetteScan | TableScan, Field(discriminator="kind")
]
