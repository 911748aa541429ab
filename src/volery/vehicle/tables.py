"""Words in which airframe files are checked: a frozen table and the ranges of its numbers."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Vector = tuple[float, float, float]
PositiveVector = tuple[Positive, Positive, Positive]


class Table(BaseModel):
    """A table of a data file: frozen, finite, without keys that nobody knows."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
