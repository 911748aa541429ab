"""What scenarios are made of: frozen, checked data and the common kinds of numbers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Topic = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*$", max_length=120)]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Rate = Annotated[float, Field(gt=0.0, le=1000.0)]


class Data(BaseModel):
    """Frozen data; unknown keys and numbers that are not finite are refused."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, str_strip_whitespace=True
    )


class SensorData(Data):
    """What every sensor states."""

    phase_s: NonNegative = 0.0
    """Time of the first measurement."""


class MountedSensor(SensorData):
    """A sensor with a place on the UAV."""

    position_m: Vector3 = (0.0, 0.0, 0.0)
    """Place of the sensor frame in the body, FLU."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    noise: bool = True


def check_rectangle(region: tuple[float, float, float, float] | None) -> None:
    """ValueError unless `region` is x_min, y_min, x_max, y_max, or None."""
    if region is not None and not (region[0] < region[2] and region[1] < region[3]):
        raise ValueError("region_m must be [x_min, y_min, x_max, y_max] with min < max")
