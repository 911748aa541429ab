"""Particles in the air of a scenario."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from volery.scenario.base import Data

MAX_RAIN_MM_H = 200.0
MAX_SNOW_MM_H = 20.0
"""Maximum rate of snow as water."""
MIN_VISIBILITY_M = 5.0
MAX_VISIBILITY_M = 100_000.0

_Visibility = Annotated[float, Field(ge=MIN_VISIBILITY_M, le=MAX_VISIBILITY_M)]


class Weather(Data):
    """Rain, snow, fog and dust; uniform, and constant until changed."""

    rain_mm_h: Annotated[float, Field(ge=0.0, le=MAX_RAIN_MM_H)] = 0.0
    """Rate of rain; 0: none."""
    snow_mm_h: Annotated[float, Field(ge=0.0, le=MAX_SNOW_MM_H)] = 0.0
    """Rate as water."""
    fog_visibility_m: _Visibility | None = None
    """Meteorological optical range in the fog alone; None: no fog."""
    dust_visibility_m: _Visibility | None = None
    """Meteorological optical range in the dust alone; None: no dust."""
