"""Effect of rain, snow, fog and dust on LIDARs: weaker echoes, and false ones from the air.

The unit of echo strength is the weakest echo that the sensor detects: that of a surface which
reflects `threshold_reflectivity`, at normal incidence, at `max_m` in clear air. As for dropouts all
surfaces count alike, so that an echo at range r has (max_m / r)^2 exp(-2 a r), a the extinction at
905 nm. The echo is as weak as one in clear air at r exp(a r), and is lost like that one: beyond
max_m always.

False echoes are a Poisson process along the beam for each kind of particles, with a rate per metre:

- Drops and flakes: the beam, of diameter d + t r (t its divergence), holds N0 / s exp(-s D) of
  them per volume that are larger than D, and one is detected if it returns enough of the light:
  D >= (d + t r) (r + o) exp(a r) / max_m sqrt(rho / (4 b)), with b D^2 the light that it returns
  per steradian and unit of irradiance, and rho the threshold's reflectivity.
- Fog and dust: grains are too many to be resolved. The echo of a pulse length p has the mean
  strength m = pi beta p (max_m / (r + o))^2 exp(-2 a r) / rho, and, from speckle, an exponential
  distribution about it (Goodman, "Speckle Phenomena in Optics"; fully developed speckle is a
  modelling choice, the strongest case): exp(-1 / m) / p per metre are detected.

o, the overlap, is the range at which the receiver sees half of the amplitude of a near echo; the
fraction soon approaches 1 beyond it. An echo within a pulse length before a surface is
lost in the surface's.

The threshold is that of Kilic et al. 2021 (LISA), with reflectivity 0.9; the crossover at 1 m and
fog's backscatter beta = 0.046 / V are those of Hahner et al. 2021 ("Fog simulation on real LiDAR
point clouds"), the latter after Rasshofer, Spies and Spies 2011. Dust: extinction over 55 sr
(Muller et al. 2007, Saharan dust). A drop's b is that of the two rays along its axis, from the
front and, focused, from the back (van de Hulst, "Light Scattering by Small Particles", 12.2):
(R + R (1 - R)^2 (n / (2 - n))^2) / 16 with R = ((n - 1) / (n + 1))^2, n = 1.328. A flake's is its
extinction, 2 pi D^2 / 4, over 30 sr (modelling choice: ice clouds have 20 to 40).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.sensors.lidar.lidar_model import LidarModel
from volery.world.weather.particles import (
    Particles,
    dust_extinction,
    extinction,
    number_per_mm,
    rain_extinction,
    rain_slope,
    snow_extinction,
    snow_slope,
)

WAVELENGTH_NM = 905.0
"""Wavelength of all shipped LIDARs except Ouster's, which have 865 nm."""
RAIN, SNOW, VOLUME = 0, 1, 2
"""Kinds of false echoes; VOLUME is that of fog and dust."""
KINDS = 3
_STEPS = 400
"""Entries of the tables over the range."""

_INDEX = 1.328
_FRESNEL = ((_INDEX - 1.0) / (_INDEX + 1.0)) ** 2
_DROP = _FRESNEL * (1.0 + (1.0 - _FRESNEL) ** 2 * (_INDEX / (2.0 - _INDEX)) ** 2) / 16.0
"""Factor b of a drop of water."""
_FLAKE = 2.0 * math.pi / 4.0 / 30.0
"""Factor b of a flake of snow."""
_FOG_BACKSCATTER = 0.046
"""Backscatter coefficient of fog times its visibility, 1/sr."""
_DUST_RATIO_SR = 55.0


class ParticleTable(NamedTuple):
    """Effect of particles in the air on a LIDAR, for kernels."""

    extinction: float
    """1/m at the LIDAR's wavelength."""
    range: Array
    """(K,) m, ascending: from the minimum range to the reduced maximum range."""
    events: Array
    """(KINDS, K) mean number of false echoes of a beam up to that range."""
    never: Array
    """(KINDS,) probability that an unobstructed beam has none."""
    spread: Array
    """(KINDS, K) spread of the strength F of a false echo there: F = (1 + spread e)^2 of drops and
    flakes, 1 + spread e of fog and dust, e exponentially distributed."""
    brightness: float
    """Intensity of an echo of strength 1 at the maximum range, without the loss over the range."""


def particle_table(model: LidarModel, particles: Particles) -> ParticleTable:
    """Returns the effect of particles on a LIDAR; `particles` must not be clear air."""
    whole = extinction(particles, WAVELENGTH_NM)
    max_range = max_range_m(model.range.max_m, whole)
    ranges = np.geomspace(max(model.range.min_m, 0.01), max_range, _STEPS)
    rates, spread = np.zeros((KINDS, _STEPS)), np.zeros((KINDS, _STEPS))
    if particles.rain_mm_h > 0.0:
        slope = rain_slope(particles.rain_mm_h)
        number = number_per_mm(rain_extinction(particles.rain_mm_h), slope)
        rates[RAIN], spread[RAIN] = _grains(model, ranges, whole, number, slope, _DROP)
    if particles.snow_mm_h > 0.0:
        slope = snow_slope(particles.snow_mm_h)
        number = number_per_mm(snow_extinction(particles.snow_mm_h, WAVELENGTH_NM), slope)
        rates[SNOW], spread[SNOW] = _grains(model, ranges, whole, number, slope, _FLAKE)
    backscatter = backscatter_per_m(particles)
    if backscatter > 0.0:
        rates[VOLUME], spread[VOLUME] = _volume(model, ranges, whole, backscatter)
    shine = model.intensity
    scale = 0.0 if shine is None else shine.scale * model.particles.threshold_reflectivity
    events = _summed(rates, ranges)
    return ParticleTable(whole, ranges, events, np.exp(-events[:, -1]), spread, scale)


def max_range_m(clear_m: float, extinction_per_m: float) -> float:
    """Returns the range r, m, with r exp(a r) = clear_m, beyond which nothing is detected."""
    r = clear_m / (1.0 + extinction_per_m * clear_m)
    for _ in range(50):  # Newton's method for log r + a r, which is concave: it does not overshoot
        r -= (math.log(r / clear_m) + extinction_per_m * r) / (1.0 / r + extinction_per_m)
    return r


def backscatter_per_m(particles: Particles) -> float:
    """Returns the backscatter coefficient of fog and dust, 1/(m sr)."""
    fog = _FOG_BACKSCATTER / particles.fog_visibility_m
    return fog + dust_extinction(particles.dust_visibility_m) / _DUST_RATIO_SR


def _grains(
    model: LidarModel, r: Array, whole: float, number: float, slope: float, fraction: float
) -> tuple[Array, Array]:
    """Returns detected grains per metre and the spread of their strengths at ranges `r`."""
    sight = model.particles
    width = sight.beam_diameter_m + model.mixed_pixels.divergence_rad * r
    factor = math.sqrt(sight.threshold_reflectivity / (4.0 * fraction)) / model.range.max_m
    min_mm = 1e3 * factor * width * (r + sight.overlap_m) * np.exp(whole * r)  # mm
    rates = math.pi / 4.0 * width**2 * number / slope * np.exp(-slope * min_mm)
    return rates, 1.0 / (slope * min_mm)


def _volume(model: LidarModel, r: Array, whole: float, backscatter: float) -> tuple[Array, Array]:
    """Returns detected pulse lengths per metre and the mean strength of all at ranges `r`."""
    sight, length = model.particles, max(model.mixed_pixels.pulse_length_m, 0.01)
    bright = math.pi * backscatter * length / sight.threshold_reflectivity
    near = (model.range.max_m / (r + sight.overlap_m)) ** 2
    mean = np.maximum(bright * near * np.exp(-2.0 * whole * r), 1e-3)
    return np.exp(-1.0 / mean) / length, mean


def _summed(rates: Array, ranges: Array) -> Array:
    """Returns the integrals (KINDS, K) of rates from the first range on."""
    pieces = 0.5 * (rates[:, 1:] + rates[:, :-1]) * np.diff(ranges)
    return np.concatenate([np.zeros((KINDS, 1)), np.cumsum(pieces, axis=1)], axis=1)
