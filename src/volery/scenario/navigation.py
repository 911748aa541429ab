"""Scenario data of navigation: the map's position on the earth and its sensors."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from volery.scenario.base import Data, MountedSensor, Name, Rate, Vector2, check_rectangle

# ------------------------------------------------------------------------------------------ world


class Origin(Data):
    """Position of the map's origin on the earth (WGS-84); x points east, y north.

    The default is that of PX4's simulations: Zurich, Irchel Park.
    """

    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 47.397742
    """Geodetic latitude, north positive."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)] = 8.545594
    """Longitude, east positive."""
    altitude_m: Annotated[float, Field(ge=-500.0, le=9000.0)] = 488.0
    """Height above the ellipsoid and above sea level: the geoid is ignored."""


class MagneticField(Data):
    """The earth's magnetic field; omitted values follow from the origin (IGRF-14)."""

    declination_deg: Annotated[float, Field(ge=-180.0, le=180.0)] | None = None
    """Declination east of true north."""
    inclination_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None
    """Inclination below the horizon."""
    strength_ut: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Microtesla."""


class _DeniedArea(Data):
    height_m: Vector2 | None = None
    """Minimum and maximum z in the map; omitted: all."""

    @model_validator(mode="after")
    def _height_is_a_range(self) -> Self:
        if self.height_m is not None and not self.height_m[0] < self.height_m[1]:
            raise ValueError("height_m must be [lowest, highest] with lowest < highest")
        return self


class DeniedBox(_DeniedArea):
    """A rectangle of the map without satellite signals."""

    kind: Literal["box"] = "box"
    """A rectangle of the map."""
    region_m: tuple[float, float, float, float]
    """x_min, y_min, x_max, y_max."""

    @model_validator(mode="after")
    def _region_is_a_rectangle(self) -> Self:
        check_rectangle(self.region_m)
        return self

    @property
    def corners_m(self) -> tuple[Vector2, ...]:
        """Corners of the rectangle, in order around."""
        x0, y0, x1, y1 = self.region_m
        return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


class DeniedPolygon(_DeniedArea):
    """A polygon of the map without satellite signals."""

    kind: Literal["polygon"] = "polygon"
    """A polygon of the map."""
    corners_m: Annotated[tuple[Vector2, ...], Field(min_length=3)]
    """Corners in order around; the last connects to the first."""

    @model_validator(mode="after")
    def _covers_ground(self) -> Self:
        if len(set(self.corners_m)) < 3:
            raise ValueError("corners_m must hold at least three different corners")
        return self


DeniedArea: TypeAlias = Annotated[DeniedBox | DeniedPolygon, Field(discriminator="kind")]


# ---------------------------------------------------------------------------------------- sensors


class GnssSensor(MountedSensor):
    """GNSS receiver; its antenna is at `position_m`."""

    kind: Literal["gnss"] = "gnss"
    """A GNSS receiver."""
    name: Name = "fix"
    """Name of the sensor in frames and topics."""
    model: str = "gnss_m8"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 5.0
    """Rate of samples."""


class BarometerSensor(MountedSensor):
    """Static pressure and temperature."""

    kind: Literal["barometer"] = "barometer"
    """A barometer."""
    name: Name = "pressure"
    """Name of the sensor in frames and topics."""
    model: str = "barometer_px4"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 50.0
    """Rate of samples."""


class MagnetometerSensor(MountedSensor):
    """Three-axis magnetometer."""

    kind: Literal["magnetometer"] = "magnetometer"
    """A magnetometer."""
    name: Name = "mag"
    """Name of the sensor in frames and topics."""
    model: str = "magnetometer_px4"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 100.0
    """Rate of samples."""


NavigationSensor: TypeAlias = GnssSensor | BarometerSensor | MagnetometerSensor
