"""Scenario data of cameras and daylight."""

from __future__ import annotations

import datetime
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, MountedSensor, Name, Rate

Side = Annotated[int, Field(ge=1, le=8192)]


class Stereo(Data):
    """Two equal parallel cameras that expose at the same time."""

    baseline_m: Annotated[float, Field(gt=0.0, le=10.0)]
    """Distance from the left camera to the right one."""


class CameraSensor(MountedSensor):
    """A camera of a named model; x of its frame is the optical axis, z is up."""

    kind: Literal["camera"] = "camera"
    """A camera for colour and depth."""
    name: Name = "camera"
    """Name of the sensor in frames and topics."""
    model: str = "pinhole"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 10.0
    """Rate of images."""
    width: Side | None = None
    """Pixels; this key and the following override the model's."""
    height: Side | None = None
    """Pixels; None: the model's."""
    horizontal_fov_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = None
    """Horizontal field of view; None: the model's."""
    samples: Literal[1, 4] | None = None
    """Rays per pixel; None: the model's."""
    depth_encoding: Literal["32FC1", "16UC1"] = "32FC1"
    """Encoding of the depth image: metres, or millimetres with 0 for unknown (REP 118)."""
    compressed: Literal["jpeg", "png", "none"] = "jpeg"
    """Codec of the compressed colour image; none: publishes no compressed colour and depth."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 95
    """JPEG quality as in OpenCV and image_transport; 95 is their default."""
    points: Literal["none", "xyz", "xyzrgb"] = "none"
    """Fields of the point cloud."""
    stereo: Stereo | None = None
    """Makes a pair, `NAME/left` and `NAME/right`; `position_m` is the centre between them."""


class Daylight(Data):
    """Sun, by its angles or by the hour, and clearness of the air."""

    sun_elevation_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 50.0
    """Elevation of the sun above the horizon."""
    sun_azimuth_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 135.0
    """Azimuth clockwise from north."""
    hour_of_day: Annotated[float, Field(ge=0.0, le=24.0)] | None = None
    """Instead of the angles: local mean solar time at the map's origin. The sun does not move."""
    date: datetime.date = datetime.date(2025, 6, 21)
    """Date for the sun's angles by the hour, here or changed during the run."""
    visibility_m: Annotated[float, Field(ge=1.0, le=1e6)] = 20_000.0
    """Meteorological optical range: distance at which contrast has faded to a twentieth."""

    @model_validator(mode="after")
    def _sun_has_one_source(self) -> Self:
        usual = type(self).model_fields
        angles = ("sun_elevation_deg", "sun_azimuth_deg")
        has_angles = any(getattr(self, name) != usual[name].default for name in angles)
        if self.hour_of_day is not None and has_angles:
            raise ValueError("hour_of_day replaces the sun's angles; leave them out")
        return self
