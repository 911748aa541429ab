"""LIDAR model: pattern, range, noise and intensity, read from a data file."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from volery.sensors.lidar.echo_kernels import MAX_ECHOES, LidarConstants
from volery.sensors.lidar.scan_patterns import ScanPattern, TableScan
from volery.sensors.model import SensorModel, find_model, read_model
from volery.world.materials import REFLECTIVITY

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class RangeLimits(SensorModel):
    """Limits and resolution of measured ranges."""

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
    """Fractions of beams lost at maximum range and at grazing incidence."""

    far: Share
    grazing: Share


class MixedPixels(SensorModel):
    """Beams that straddle an edge."""

    divergence_rad: NonNegativeFloat
    least_jump_m: NonNegativeFloat
    pulse_length_m: NonNegativeFloat
    first_echo_share: Share


class Intensity(SensorModel):
    """I = scale reflectivity cos(incidence)^incidence_exponent (reference / r)^range_exponent.

    Ranges below `reference_range_m` count as that, and I is limited to `maximum`.
    """

    scale: PositiveFloat
    """Intensity of a perfect reflector at normal incidence and the reference range."""
    incidence_exponent: NonNegativeFloat
    range_exponent: NonNegativeFloat
    """2 for the power of the echo, 0 for a sensor that compensates for the range."""
    reference_range_m: PositiveFloat
    maximum: PositiveFloat
    noise: NonNegativeFloat
    """Standard deviation as a fraction of I."""
    published: bool = True
    """Whether planar scans carry intensities by default; point clouds always do."""


class WarmUp(SensorModel):
    """Range bias after the start: bias exp(-t / time constant)."""

    bias_m: float = 0.0
    time_constant_s: PositiveFloat = 1.0


class ParticleVisibility(SensorModel):
    """Interaction with particles in the air; `particle_echoes` explains the model."""

    beam_diameter_m: NonNegativeFloat = 0.005
    """Diameter at the scanner (modelling choice)."""
    overlap_m: NonNegativeFloat = 1.0
    """Range below which the receiver sees part of the beam (Hahner et al. 2021: from 1 m on)."""
    threshold_reflectivity: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    """Reflectivity of the surface that is just detected at `max_m` (Kilic et al. 2021)."""


class LidarModel(SensorModel):
    """A scanner; its data file names the sources of the numbers."""

    name: str
    echoes: Annotated[int, Field(ge=1, le=MAX_ECHOES)] = 1
    """Maximum number of echoes per beam."""
    scan: ScanPattern
    range: RangeLimits
    noise: RangeNoise
    dropout: Dropout
    mixed_pixels: MixedPixels
    intensity: Intensity | None = None
    warm_up: WarmUp = WarmUp()
    particles: ParticleVisibility = ParticleVisibility()
    exact: bool = False
    """Exact ranges: without noise, rounding, dropout and mixing."""

    @property
    def beams(self) -> int:
        """Number of beams of a sweep."""
        return self.scan.beam_count

    @property
    def sweep_duration_ns(self) -> int:
        """Time from the start of a sweep to its last beam, ns of simulated time."""
        return self.scan.sweep_ns

    @cached_property
    def constants(self) -> LidarConstants:
        """Parameters of the model for kernels."""
        shine = self.intensity or _NO_INTENSITY
        return LidarConstants(
            stride=self.scan.stride,
            sweep_ns=self.sweep_duration_ns,
            range_min=self.range.min_m,
            range_max=self.range.max_m,
            resolution=self.range.resolution_m,
            noise_floor=self.noise.floor_m,
            noise_slope=self.noise.slope,
            noise_offset=self.noise.offset_m,
            dropout_far=self.dropout.far,
            dropout_grazing=self.dropout.grazing,
            half_footprint=0.5 * self.mixed_pixels.divergence_rad / self.scan.spacing_rad,
            min_jump=self.mixed_pixels.least_jump_m,
            pulse_length=self.mixed_pixels.pulse_length_m,
            first_echo_share=self.mixed_pixels.first_echo_share,
            warm_up_bias=self.warm_up.bias_m,
            warm_up_s=self.warm_up.time_constant_s,
            brightness=shine.scale * REFLECTIVITY,
            incidence_exponent=shine.incidence_exponent,
            range_exponent=shine.range_exponent,
            reference_range=shine.reference_range_m,
            brightest=shine.maximum,
            brightness_noise=shine.noise,
            noise=not self.exact,
        )

    def without_noise(self) -> LidarModel:
        """Returns the same scanner with exact ranges."""
        return self.changed(exact=True)

    def changed(self, **values: Any) -> LidarModel:
        """Returns a copy with other values; sections are updated by the given keys."""
        data = self.model_dump()
        for key, value in values.items():
            data[key] = {**(data[key] or {}), **value} if isinstance(value, dict) else value
        return _placed(LidarModel.model_validate(data), self.folder)

    @property
    def folder(self) -> Path:
        """Folder of the files that the model names."""
        return self.scan._folder if isinstance(self.scan, TableScan) else Path()


_NO_INTENSITY = Intensity(
    scale=1.0,
    incidence_exponent=0.0,
    range_exponent=0.0,
    reference_range_m=1.0,
    maximum=1.0,
    noise=0.0,
)


def load_lidar(name: str | Path = "utm_30lx", folder: Path | None = None) -> LidarModel:
    """Returns a scanner by shipped name or `.toml` path, also relative to the scenario's `folder`.

    Raises `DataFileError`, naming file, key and allowed values, for an invalid file.
    """
    path = find_model(name, "LIDAR", folder)
    return _placed(read_model(path, LidarModel), path.parent)


def _placed(model: LidarModel, folder: Path) -> LidarModel:
    """Returns the model after reading its beam table, if any, from `folder`."""
    if isinstance(model.scan, TableScan):
        model.scan._folder = folder
        _ = model.scan.time_ns  # raises now if the table is invalid
    return model
