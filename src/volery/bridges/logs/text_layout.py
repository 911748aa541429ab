"""Column layout of a scanner's plain text log: a small TOML file.

    [ranges]
    first_column = 24
    beams = 682
    angle_min_deg = -120.0
    angle_max_deg = 120.0
    range_max_m = 5.6

Columns are numbered from 0. All other keys have defaults.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from volery.scenario.base import Data, Name, NonNegative, Positive, Topic, Vector3

Column = Annotated[int, Field(ge=0, le=100_000)]
Turn = Annotated[float, Field(ge=-360.0, le=360.0)]


class _Table(Data):
    """A table whose numbers must be numbers: neither texts nor true or false."""

    @field_validator("*", mode="before")
    @classmethod
    def _no_text_for_a_number(cls, value: Any) -> Any:
        found = value if isinstance(value, list | tuple) else [value]
        if any(isinstance(one, str | bool) for one in found):
            raise ValueError("must be a number, without quotation marks")
        return value


class TimeColumn(_Table):
    """Time of a scan."""

    column: Column = 0
    unit_s: Positive = 1e-6
    """Unit of the time; microseconds by default."""


class RangeColumns(_Table):
    """Beams of one scan, from `angle_min_deg` to `angle_max_deg`, counter-clockwise from above.

    If the minimum is the greater angle, the scanner turns clockwise.
    """

    first_column: Column
    beams: Annotated[int, Field(ge=2, le=100_000)]
    angle_min_deg: Turn
    angle_max_deg: Turn
    range_max_m: Positive
    range_min_m: NonNegative = 0.02
    unit_m: Positive = 1e-3
    no_echo: tuple[float, ...] = (0.0,)
    """Values in the file that mean: no return."""
    sweep_s: NonNegative = 0.0
    """Time from the first beam to the last one; the scan's time is that of the first."""

    @model_validator(mode="after")
    def _sweeps_some_way(self) -> Self:
        if self.angle_min_deg == self.angle_max_deg:
            raise ValueError("angle_min_deg and angle_max_deg must differ")
        if self.range_min_m >= self.range_max_m:
            raise ValueError("range_min_m must be less than range_max_m")
        return self


class OdometryColumns(_Table):
    """Pose in the plane with each scan: columns of x, y and yaw."""

    columns: tuple[Column, Column, Column]
    unit_m: Positive = 1e-3
    unit_deg: Positive = 1.0


class WheelColumns(_Table):
    """Counters of two wheels with each scan, which yield a pose in the plane."""

    columns: tuple[Column, Column]
    """Left, right."""
    unit_m: Positive
    """Distance of a wheel's rim per unit of its counter."""
    apart_m: Positive
    """Distance between the wheels."""


class PositionColumns(_Table):
    """Pose of the scanner in the body, FLU."""

    position_m: Vector3 = (0.0, 0.0, 0.0)
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)


class TextLayout(Data):
    """Layout of a log with one scan per line.

    Numbers are separated by blanks, commas or semicolons.
    """

    ranges: RangeColumns
    time: TimeColumn = TimeColumn()
    odometry: OdometryColumns | None = None
    wheels: WheelColumns | None = None
    """Alternative to `odometry`."""
    mount: PositionColumns = PositionColumns()
    uav: Name = "uav1"
    topic: Topic = "laser/horizontal/scan"
    """Topic of the scans, below the UAV's name."""

    @model_validator(mode="after")
    def _has_one_odometry(self) -> Self:
        if self.odometry is not None and self.wheels is not None:
            raise ValueError("give either odometry or wheels, not both")
        return self

    @property
    def columns(self) -> int:
        """Number of columns that a line must have."""
        last = [self.time.column, self.ranges.first_column + self.ranges.beams - 1]
        moving = self.odometry or self.wheels
        return 1 + max(last + list(moving.columns if moving else ()))
