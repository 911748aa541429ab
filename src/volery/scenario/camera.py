"""Scenario data of cameras and of the light they see by."""

from __future__ import annotations

import datetime
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, MountedSensor, Name, Rate

Side = Annotated[int, Field(ge=1, le=8192)]


class Stereo(Data):
    """Two equal cameras side by side that look the same way, and expose at the same time."""

    baseline_m: Annotated[float, Field(gt=0.0, le=10.0)]
    """From the left one to the right one."""


class CameraSensor(MountedSensor):
    """A camera of a named model; x of its frame looks along the optical axis, z is up."""

    kind: Literal["camera"]
    name: Name = "camera"
    model: str = "pinhole"
    rate_hz: Rate = 10.0
    width: Side | None = None
    """Pixels, instead of the model's; so are those that follow."""
    height: Side | None = None
    horizontal_fov_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = None
    samples: Literal[1, 4] | None = None
    depth_encoding: Literal["32FC1", "16UC1"] = "32FC1"
    """Of the depth picture: metres, or millimetres with 0 for what is not known (REP 118)."""
    compressed: Literal["jpeg", "png", "none"] = "jpeg"
    """Codec of the compressed colour picture; none: neither that nor a compressed depth."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 95
    """As OpenCV and image_transport count it; 95 is their default."""
    points: Literal["none", "xyz", "xyzrgb"] = "none"
    """What a point of the cloud has."""
    stereo: Stereo | None = None
    """Makes it a pair, `NAME/left` and `NAME/right`; `position_m` is the middle between them."""


class Daylight(Data):
    """Sun, by its angles or by the hour, and clearness of the air."""

    sun_elevation_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 50.0
    sun_azimuth_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 135.0
    """Clockwise from north."""
    hour_of_day: Annotated[float, Field(ge=0.0, le=24.0)] | None = None
    """Instead of the angles: local mean solar time at the map's origin. The sun stands still."""
    date: datetime.date = datetime.date(2025, 6, 21)
    """Where the sun stands by the hour, here or changed while running."""
    visibility_m: Annotated[float, Field(ge=1.0, le=1e6)] = 20_000.0
    """Meteorological optical range: where the contrast of things has faded to a twentieth."""

    @model_validator(mode="after")
    def _sun_is_told_once(self) -> Self:
        usual = type(self).model_fields
        angles = ("sun_elevation_deg", "sun_azimuth_deg")
        told = any(getattr(self, name) != usual[name].default for name in angles)
        if self.hour_of_day is not None and told:
            raise ValueError("hour_of_day takes the place of the sun's angles; leave them out")
        return self
