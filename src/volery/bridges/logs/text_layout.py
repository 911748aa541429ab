"""What stands where in a plain text log of a scanner: a small TOML file.

    [ranges]
    first_column = 24
    beams = 682
    angle_min_deg = -120.0
    angle_max_deg = 120.0
    range_max_m = 5.6

Columns are numbered from 0. Everything else has a default.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from volery.scenario.base import Data, Name, NonNegative, Positive, Topic, Vector3

Column = Annotated[int, Field(ge=0, le=100_000)]
Turn = Annotated[float, Field(ge=-360.0, le=360.0)]


class _Table(Data):
    """Whose numbers are numbers: neither texts in quotation marks nor true or false."""

    @field_validator("*", mode="before")
    @classmethod
    def _no_text_for_a_number(cls, value: Any) -> Any:
        found = value if isinstance(value, list | tuple) else [value]
        if any(isinstance(one, str | bool) for one in found):
            raise ValueError("numbers stand here, without quotation marks")
        return value


class TimeColumn(_Table):
    """When a scan was taken."""

    column: Column = 0
    unit_s: Positive = 1e-6
    """Microseconds, unless stated otherwise."""


class RangeColumns(_Table):
    """The beams of one scan, from `angle_min_deg` to `angle_max_deg`, counter-clockwise from above.

    Where the minimum is the greater angle, the scanner turns clockwise.
    """

    first_column: Column
    beams: Annotated[int, Field(ge=2, le=100_000)]
    angle_min_deg: Turn
    angle_max_deg: Turn
    range_max_m: Positive
    range_min_m: NonNegative = 0.02
    unit_m: Positive = 1e-3
    no_echo: tuple[float, ...] = (0.0,)
    """Numbers in the file that say: nothing was met."""
    sweep_s: NonNegative = 0.0
    """From the first beam to the last one; the scan's time is that of the first."""

    @model_validator(mode="after")
    def _sweeps_some_way(self) -> Self:
        if self.angle_min_deg == self.angle_max_deg:
            raise ValueError("angle_min_deg and angle_max_deg must differ")
        if self.range_min_m >= self.range_max_m:
            raise ValueError("range_min_m must be less than range_max_m")
        return self


class OdometryColumns(_Table):
    """A pose in the plane beside each scan: columns of x, y and yaw."""

    columns: tuple[Column, Column, Column]
    unit_m: Positive = 1e-3
    unit_deg: Positive = 1.0


class WheelColumns(_Table):
    """Two wheels' counters beside each scan, which make a pose in the plane."""

    columns: tuple[Column, Column]
    """Left, right."""
    unit_m: Positive
    """Way of a wheel's rim in one unit of its counter."""
    apart_m: Positive
    """Between the wheels."""


class PositionColumns(_Table):
    """Of the scanner in the body, FLU."""

    position_m: Vector3 = (0.0, 0.0, 0.0)
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)


class TextLayout(Data):
    """A log with one scan a line, its numbers parted by blanks, commas or semicolons."""

    ranges: RangeColumns
    time: TimeColumn = TimeColumn()
    odometry: OdometryColumns | None = None
    wheels: WheelColumns | None = None
    """In the place of `odometry`."""
    mount: PositionColumns = PositionColumns()
    uav: Name = "uav1"
    topic: Topic = "laser/horizontal/scan"
    """Of the scans, below the UAV's name."""

    @model_validator(mode="after")
    def _has_one_odometry(self) -> Self:
        if self.odometry is not None and self.wheels is not None:
            raise ValueError("either odometry or wheels can be given")
        return self

    @property
    def columns(self) -> int:
        """How many columns a line must have."""
        last = [self.time.column, self.ranges.first_column + self.ranges.beams - 1]
        moving = self.odometry or self.wheels
        return 1 + max(last + list(moving.columns if moving else ()))
