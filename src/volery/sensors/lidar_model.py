"""What a planar scanning range finder is: pattern, reach and noise, from a data file."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from volery.core.clock import ns_from_s
from volery.sensors.lidar_kernels import LidarConstants
from volery.sensors.model import SensorModel, load_model

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Scan(SensorModel):
    """When and where to the beams go."""

    beams: Annotated[int, Field(ge=2)]
    angle_min_rad: float
    angle_max_rad: float
    rate_hz: PositiveFloat
    sweep_duration_s: PositiveFloat
    """From the first beam to the last; the rest of a turn is blind."""

    @model_validator(mode="after")
    def _is_one_turn(self) -> Self:
        if not self.angle_max_rad > self.angle_min_rad:
            raise ValueError("angle_max_rad must exceed angle_min_rad")
        if self.sweep_duration_s > 1.0 / self.rate_hz:
            raise ValueError("sweep_duration_s must fit in one turn of 1 / rate_hz")
        return self


class Reach(SensorModel):
    """What distances are measured."""

    min_m: NonNegativeFloat
    max_m: PositiveFloat
    resolution_m: PositiveFloat

    @model_validator(mode="after")
    def _is_an_interval(self) -> Self:
        if not self.min_m < self.max_m:
            raise ValueError("min_m must be below max_m")
        return self


class RangeNoise(SensorModel):
    """sigma(r) = max(floor, slope r + offset)."""

    floor_m: NonNegativeFloat
    slope: NonNegativeFloat
    offset_m: NonNegativeFloat


class Dropout(SensorModel):
    """Shares of beams lost at full reach and at grazing incidence."""

    far: Share
    grazing: Share


class MixedPixels(SensorModel):
    """Beams that straddle an edge."""

    divergence_rad: NonNegativeFloat
    least_jump_m: NonNegativeFloat
    pulse_length_m: NonNegativeFloat
    first_echo_share: Share


class LidarModel(SensorModel):
    """A planar scanner; where the numbers come from stands in its data file."""

    name: str
    scan: Scan
    range: Reach
    noise: RangeNoise
    dropout: Dropout
    mixed_pixels: MixedPixels
    exact: bool = False
    """Exact distances: nothing is disturbed, rounded, lost or mixed."""

    @property
    def beams(self) -> int:
        """Beams of a scan."""
        return self.scan.beams

    @property
    def angle_increment_rad(self) -> float:
        """Angle from a beam to the next."""
        return (self.scan.angle_max_rad - self.scan.angle_min_rad) / (self.beams - 1)

    @property
    def time_increment_s(self) -> float:
        """Time from a beam to the next."""
        return self.scan.sweep_duration_s / (self.beams - 1)

    @property
    def sweep_duration_ns(self) -> int:
        """Duration of a sweep on the simulation's clock."""
        return ns_from_s(self.scan.sweep_duration_s)

    @cached_property
    def angles(self) -> NDArray[np.float64]:
        """(beams,) angle of each beam about the sensor's z axis, rad."""
        return np.linspace(self.scan.angle_min_rad, self.scan.angle_max_rad, self.beams)

    @cached_property
    def constants(self) -> LidarConstants:
        """The model as kernels take it."""
        return LidarConstants(
            cosine=np.cos(self.angles),
            sine=np.sin(self.angles),
            sweep_ns=self.sweep_duration_ns,
            range_min=self.range.min_m,
            range_max=self.range.max_m,
            resolution=self.range.resolution_m,
            noise_floor=self.noise.floor_m,
            noise_slope=self.noise.slope,
            noise_offset=self.noise.offset_m,
            dropout_far=self.dropout.far,
            dropout_grazing=self.dropout.grazing,
            half_footprint=0.5 * self.mixed_pixels.divergence_rad / self.angle_increment_rad,
            least_jump=self.mixed_pixels.least_jump_m,
            pulse_length=self.mixed_pixels.pulse_length_m,
            first_echo_share=self.mixed_pixels.first_echo_share,
            noise=not self.exact,
        )

    def without_noise(self) -> LidarModel:
        """The same scanner with exact ranges."""
        return self.changed(exact=True)

    def changed(self, **values: Any) -> LidarModel:
        """The same scanner with other values; a section is changed by the keys given for it."""
        data = self.model_dump()
        for key, value in values.items():
            data[key] = {**data[key], **value} if isinstance(value, dict) else value
        return LidarModel.model_validate(data)


def load_lidar(name: str | Path = "utm_30lx", folder: Path | None = None) -> LidarModel:
    """Scanner by shipped name or `.toml` path, also beside the scenario in `folder`.

    Raises `DataFileError` naming file, key and what is allowed.
    """
    return load_model(LidarModel, "LIDAR", name, folder)
