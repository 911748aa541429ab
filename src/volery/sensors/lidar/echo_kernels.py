"""Compiled model of one LIDAR echo: mixing at edges, noise, dropout, intensity.

All random numbers come from the scan's stream, numbered by scan and beam, so that a scan does not
depend on its batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.core.rng import normal, uniform

MAX_ECHOES = 3
"""Maximum echoes of a beam: its own surface and those beyond its two edges."""
DRAWS = 4
"""Random numbers reserved per beam: range, dropout, edge, intensity."""


class LidarConstants(NamedTuple):
    """A LIDAR model for kernels."""

    stride: int
    """Distance in beam numbers between neighbours along the sweep."""
    sweep_ns: int
    range_min: float
    range_max: float
    resolution: float
    noise_floor: float
    noise_slope: float
    noise_offset: float
    dropout_far: float
    dropout_grazing: float
    half_footprint: float
    """Half the beam's divergence over the angle between beams."""
    min_jump: float
    pulse_length: float
    first_echo_share: float
    warm_up_bias: float
    warm_up_s: float
    brightness: NDArray[np.float64]
    """(materials,) intensity at normal incidence and the reference range."""
    incidence_exponent: float
    range_exponent: float
    reference_range: float
    brightest: float
    brightness_noise: float
    noise: bool


class Surfaces(NamedTuple):
    """Surfaces that the beams of S scans hit."""

    distance: NDArray[np.float32]
    """(S, B) m; inf without a hit. B is the number of beams or more."""
    cosine: NDArray[np.float32]
    """(S, B) cosine of the angle of incidence, 0..1."""
    material: NDArray[np.uint8]
    """(S, B) `Material`."""


class Echoes(NamedTuple):
    """Measurements of S scans; E echoes per beam, nearest first."""

    ranges: NDArray[np.float32]
    """(S, E, beams) m; inf no echo, -inf below the minimum range (REP-117)."""
    intensities: NDArray[np.float32]
    """(S, E, beams), 0 without an echo; (S, 0, beams) if not requested."""


@inner_kernel
def _dropped(lidar: LidarConstants, distance: float, cosine: float, draw: float) -> bool:
    """Returns whether the echo is lost; the model's data file states the formula."""
    far = distance / lidar.range_max
    grazing = (1.0 - cosine) * (1.0 - cosine)
    kept = (1.0 - lidar.dropout_far * far * far) * (1.0 - lidar.dropout_grazing * grazing * grazing)
    return bool(draw > kept)


@inner_kernel
def beyond_edge(lidar: LidarConstants, distance: float, neighbour: float, gap: float) -> float:
    """Returns the range of a beam whose axis passes an edge at `gap`, in beam spacings.

    The part of the footprint beyond the edge sees the surface of the beam `neighbour`. Two echoes
    within a pulse length merge to their mean, weighted by energy; of two farther apart the first
    counts.
    """
    if gap >= lidar.half_footprint:
        return distance
    fraction = 0.5 * (1.0 - gap / lidar.half_footprint)
    if abs(neighbour - distance) < lidar.pulse_length:
        return distance + fraction * (neighbour - distance)
    if neighbour < distance and fraction >= lidar.first_echo_share:
        return neighbour
    return distance


@inner_kernel
def is_edge(lidar: LidarConstants, a: float, b: float) -> bool:
    """Returns whether two neighbouring beams hit surfaces that do not continue each other."""
    gap = abs(a - b)  # inf or NaN where a beam hits nothing
    return bool(lidar.min_jump < gap < np.inf)


@inner_kernel
def warm_up_bias(lidar: LidarConstants, time_ns: int) -> float:
    """Returns the range error of a device that is warming up, m."""
    if lidar.warm_up_bias == 0.0 or not lidar.noise:
        return 0.0
    bias: float = lidar.warm_up_bias * np.exp(-1e-9 * time_ns / lidar.warm_up_s)
    return bias


@inner_kernel
def disturbed(
    lidar: LidarConstants,
    r: float,
    true: float,
    cosine: float,
    bias: float,
    key: np.uint64,
    counter: int,
) -> float:
    """Returns an echo's range after noise, rounding and dropout, m. `r` is the range before."""
    sigma = max(lidar.noise_floor, lidar.noise_slope * r + lidar.noise_offset)
    r += sigma * normal(key, counter) + bias
    r = lidar.resolution * np.floor(r / lidar.resolution + 0.5)
    if _dropped(lidar, true, cosine, uniform(key, counter + 1)) or r > lidar.range_max:
        return np.inf
    if r < lidar.range_min:
        return -np.inf
    return r


@inner_kernel
def _power(base: float, exponent: float) -> float:
    """Returns `base ** exponent`; the usual exponents need no logarithm."""
    if exponent == 1.0:
        return base
    if exponent == 2.0:
        return base * base
    power: float = np.power(base, exponent)
    return power


@inner_kernel
def echo_intensity(
    lidar: LidarConstants,
    distance: float,
    cosine: float,
    material: int,
    key: np.uint64,
    counter: int,
) -> float:
    """Returns an echo's intensity; `lidar_model.Intensity` states the formula."""
    value = lidar.brightness[material]
    if lidar.incidence_exponent != 0.0:
        value *= _power(float(cosine), lidar.incidence_exponent)
    if lidar.range_exponent != 0.0:
        far = max(distance, lidar.reference_range)
        value *= _power(lidar.reference_range / far, lidar.range_exponent)
    if lidar.noise and lidar.brightness_noise > 0.0:
        value *= 1.0 + lidar.brightness_noise * normal(key, counter + 3)
    bounded: float = min(max(value, 0.0), lidar.brightest)
    return bounded
