"""Rain and snow for cameras: drops and flakes that fall through the map.

Particles lie on a lattice that falls and drifts with the wind, one in each cell; position and size
depend on the cell's numbers alone, so that all cameras see the same particles at any time. Numbers
and sizes are those of `world.weather.particles`. Particles within `max_range_m` and above `min_mm`
are drawn; smaller or farther ones are part of the haze.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.rng import stream_key
from volery.sensors.cameras.light import Light
from volery.world.weather import Weather
from volery.world.weather.particles import (
    VISIBLE_NM,
    drop_speed,
    number_per_mm,
    rain_extinction,
    rain_slope,
    snow_extinction,
    snow_slope,
)

_MIN_MM = 0.5
_MAX_RAIN_RANGE_M, _MAX_SNOW_RANGE_M = 5.0, 8.0
"""Distances at which drops become too faint and flakes too small (modelling choices)."""
_FLAKES_FALL_M_S = 1.0
"""Fall speed of aggregates of dry snow (Locatelli and Hobbs 1974: 0.8 to 1.4 m/s)."""
_DROP_TRANSMITS = 0.94
"""Fraction of the surrounding light that a drop transmits, which shows most of the surroundings
(Garg and Nayar 2007)."""
_FLAKE_REFLECTS = 0.9
"""Reflectivity of clean snow (modelling choice)."""


class Falling(NamedTuple):
    """Drops or flakes of one kind, for kernels."""

    key: np.uint64
    """Random stream of the lattice's cells."""
    velocity: NDArray[np.float64]
    """(3,) m/s, map frame."""
    cell_m: float
    """Side of a cell, m."""
    max_range_m: float
    min_mm: float
    slope: float
    """Decay of the number of particles with the diameter, 1/mm."""
    colour: NDArray[np.float32]
    """(3,) linear colour."""


def falling_in(weather: Weather, light: Light) -> tuple[Falling, ...]:
    """Returns the particles that fall in a weather, with their colour in its light."""
    found = []
    rain, snow = weather.particles.rain_mm_h, weather.particles.snow_mm_h
    if rain > 0.0:
        slope = rain_slope(rain)
        number = number_per_mm(rain_extinction(rain), slope)
        colour = _DROP_TRANSMITS * 0.5 * (light.zenith + light.horizon)
        speed = drop_speed(_MIN_MM + 1.0 / slope)
        found.append(_falling("rain", weather, speed, number, slope, _MAX_RAIN_RANGE_M, colour))
    if snow > 0.0:
        slope = snow_slope(snow)
        number = number_per_mm(snow_extinction(snow, VISIBLE_NM), slope)
        colour = _FLAKE_REFLECTS * 0.5 * (light.overhead + light.bounce)
        max_range = _MAX_SNOW_RANGE_M
        found.append(_falling("snow", weather, _FLAKES_FALL_M_S, number, slope, max_range, colour))
    return tuple(found)


def _falling(
    name: str,
    weather: Weather,
    speed: float,
    number: float,
    slope: float,
    max_range: float,
    colour: NDArray[np.float32],
) -> Falling:
    density = number / slope * math.exp(-slope * _MIN_MM)
    x, y, z = weather.velocity_map
    return Falling(
        key=stream_key(0, f"weather/{name}"),
        velocity=np.array([x, y, z - speed]),
        cell_m=max(density, 1e-9) ** (-1.0 / 3.0),
        max_range_m=max_range,
        min_mm=_MIN_MM,
        slope=slope,
        colour=np.asarray(colour, dtype=np.float32),
    )
