"""Weather: frozen data, checked on construction (`CommandError`).

The velocity of the air is the mean wind (a steady vector, with or without a profile over height, or
a field over the map) plus all gusts plus turbulence. All vectors are map frame, ENU, m/s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from volery.core.errors import CommandError
from volery.scenario.wind import MAX_GUSTS, MAX_WIND_M_S
from volery.world.weather.particles import CLEAR_AIR, Particles, check_range
from volery.world.weather.wind_field import WindField

Vector = tuple[float, float, float]

_STILL: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LogProfile:
    """Neutral surface layer: the steady wind times ln(h / z0) / ln(reference / z0).

    h: m above the terrain, at most 304.8 m (1000 ft, the height up to which MIL-F-8785C uses this
    law); there is no wind below z0.
    """

    reference_height_m: float = 10.0
    """Height of the steady wind (default: that of weather stations, WMO)."""
    roughness_m: float = 0.03
    """Roughness length z0 (default: open, grass; classes of Davenport and Wieringa)."""

    def __post_init__(self) -> None:
        check_range("roughness_m", self.roughness_m, 1e-6, 10.0)
        check_range("reference_height_m", self.reference_height_m, 0.1, 304.8)
        if self.reference_height_m < 2.0 * self.roughness_m:
            raise CommandError("reference_height_m must be at least twice roughness_m")


@dataclass(frozen=True, slots=True)
class PowerProfile:
    """The steady wind times (h / reference) ** exponent, h as in `LogProfile`."""

    reference_height_m: float = 10.0
    exponent: float = 1.0 / 7.0
    """Default: the one-seventh power law of neutral air over open land."""

    def __post_init__(self) -> None:
        check_range("reference_height_m", self.reference_height_m, 0.1, 304.8)
        check_range("exponent", self.exponent, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Gust:
    """A 1-cosine gust (MIL-F-8785C): amplitude / 2 (1 - cos(pi t / rise)), then the amplitude.

    It falls along the same curve, to end at `end_s`. With a front, which travels at
    `front_velocity_map`, its times are those at the map's origin, and a UAV that flies against it
    meets it faster; without one it reaches all positions at once.
    """

    amplitude_map: Vector
    start_s: float
    rise_s: float
    end_s: float = math.inf
    """inf: the gust is permanent."""
    front_velocity_map: Vector = _STILL

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude_map", _wind("amplitude_map", self.amplitude_map))
        object.__setattr__(
            self, "front_velocity_map", _wind("front_velocity_map", self.front_velocity_map)
        )
        check_range("start_s", self.start_s, -1e9, 1e9)
        check_range("rise_s", self.rise_s, 1e-3, 1e6)
        # half a microsecond of slack for times that were added up
        if not self.end_s - self.start_s >= 2.0 * self.rise_s - 5e-7:
            raise CommandError("end_s must leave time to rise and to fall: start_s + 2 rise_s")
        if 0.0 < math.hypot(*self.front_velocity_map) < 0.1:
            raise CommandError("front_velocity_map must be at least 0.1 m/s, or zero")

    @property
    def has_front(self) -> bool:
        """Whether the gust travels with a front."""
        return self.front_velocity_map != _STILL


@dataclass(frozen=True, slots=True)
class Weather:
    """The air's motion everywhere and at all times, its particles, and the hour.

    `Weather((6.0, 0.0, 0.0))` is a steady wind. A field replaces the steady wind and its profile.
    `w20_m_s` is the wind at 20 ft that sets the turbulence; 0: none.
    """

    velocity_map: Vector = _STILL
    profile: LogProfile | PowerProfile | None = None
    field: WindField | None = None
    w20_m_s: float = 0.0
    gusts: tuple[Gust, ...] = ()
    particles: Particles = CLEAR_AIR
    hour_of_day: float | None = None
    """Local mean solar time, which determines the sun; None: the sun has the scenario's angles."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity_map", _wind("velocity_map", self.velocity_map))
        object.__setattr__(self, "gusts", tuple(self.gusts))
        check_range("w20_m_s", self.w20_m_s, 0.0, MAX_WIND_M_S)
        if self.hour_of_day is not None:
            check_range("hour_of_day", self.hour_of_day, 0.0, 24.0)
        if self.field is not None and (self.profile is not None or self.velocity_map != _STILL):
            raise CommandError("a wind field replaces velocity_map and profile; leave them out")
        if len(self.gusts) > MAX_GUSTS:
            raise CommandError(f"{len(self.gusts)} gusts; at most {MAX_GUSTS} are allowed at once")

    def with_gust(self, gust: Gust, now_s: float) -> Weather:
        """Returns the weather with one more gust, without those that ended by `now_s`."""
        kept = tuple(g for g in self.gusts if g.has_front or g.end_s > now_s)
        return replace(self, gusts=(*kept, gust))


def _wind(what: str, value: ArrayLike) -> Vector:
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise CommandError(f"{what} must be three numbers") from None
    if vector.shape != (3,):
        raise CommandError(f"{what} must have shape (3,), not {vector.shape}")
    if not (np.abs(vector) <= MAX_WIND_M_S).all():  # false for NaN
        raise CommandError(
            f"{what} = {vector.tolist()} is out of range; +-{MAX_WIND_M_S:g} m/s is allowed"
        )
    x, y, z = vector.tolist()
    return x, y, z


CALM = Weather()
"""Still, clear air."""
