"""What becomes of one echo of a LIDAR: mixing at edges, noise, dropout, strength; compiled.

All random numbers come from the scan's stream, numbered by scan and beam, so a scan does not depend
on its batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.core.rng import normal, uniform

MOST_ECHOES = 3
"""A beam's own surface and those beyond its two edges."""
DRAWS = 4
"""Random numbers reserved for a beam: range, dropout, edge, intensity."""


class LidarConstants(NamedTuple):
    """A LIDAR model for kernels."""

    stride: int
    """A beam's neighbours along the sweep are so many numbers before and after it."""
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
    least_jump: float
    pulse_length: float
    first_echo_share: float
    warm_up_bias: float
    warm_up_s: float
    brightness: NDArray[np.float64]
    """(materials,) intensity head on at the reference range."""
    incidence_exponent: float
    range_exponent: float
    reference_range: float
    brightest: float
    brightness_noise: float
    noise: bool


class Surfaces(NamedTuple):
    """What the beams of scans met; S rows."""

    distance: NDArray[np.float32]
    """(S, B) m; inf where nothing was met. B is the number of beams or more."""
    cosine: NDArray[np.float32]
    """(S, B) of the angle of incidence, 0..1."""
    material: NDArray[np.uint8]
    """(S, B)."""


class Echoes(NamedTuple):
    """What S scans measured; E echoes a beam, nearest first."""

    ranges: NDArray[np.float32]
    """(S, E, beams) m; inf no echo, -inf too near (REP-117)."""
    intensities: NDArray[np.float32]
    """(S, E, beams), 0 without an echo; (S, 0, beams) where they are not wanted."""


@inner_kernel
def _dropped(lidar: LidarConstants, distance: float, cosine: float, draw: float) -> bool:
    """Whether the echo is lost; the formula stands in the model's data file."""
    far = distance / lidar.range_max
    grazing = (1.0 - cosine) * (1.0 - cosine)
    kept = (1.0 - lidar.dropout_far * far * far) * (1.0 - lidar.dropout_grazing * grazing * grazing)
    return bool(draw > kept)


@inner_kernel
def beyond_edge(lidar: LidarConstants, distance: float, neighbour: float, gap: float) -> float:
    """Range of a beam whose axis passes an edge at `gap` (in beam spacings) towards `neighbour`.

    The part of the footprint beyond the edge sees the neighbour's surface. Two echoes within a
    pulse length merge to their mean, weighted by energy; of two farther apart the first counts.
    """
    if gap >= lidar.half_footprint:
        return distance
    share = 0.5 * (1.0 - gap / lidar.half_footprint)
    if abs(neighbour - distance) < lidar.pulse_length:
        return distance + share * (neighbour - distance)
    if neighbour < distance and share >= lidar.first_echo_share:
        return neighbour
    return distance


@inner_kernel
def is_edge(lidar: LidarConstants, a: float, b: float) -> bool:
    """Whether two neighbouring beams meet surfaces that are no continuation of each other."""
    gap = abs(a - b)  # inf or NaN where a beam meets nothing
    return bool(lidar.least_jump < gap < np.inf)


@inner_kernel
def warm_up_bias(lidar: LidarConstants, time_ns: int) -> float:
    """Range error of a device that is warming up."""
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
    """An echo's measured range: noise, rounding, dropout. `r` is where it comes from."""
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
    """Power; the usual exponents cost no logarithm."""
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
    """Strength of an echo; the formula stands at `lidar_model.Intensity`."""
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
