"""Compiled echoes: what the electronics of a LIDAR make of true distances.

All random numbers come from the scan's stream, numbered by scan and beam, so a scan does not depend
on its batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import normal, random_bits, uniform

MOST_ECHOES = 3
"""A beam's own surface and those beyond its two edges."""
_DRAWS = 4
"""Random numbers reserved for a beam: range, dropout, edge, intensity."""
_FIRST_ECHO_STREAM = 1 << 62
"""Number of the draw that becomes the key of the first echo's own stream."""


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
def _beyond_edge(lidar: LidarConstants, distance: float, neighbour: float, gap: float) -> float:
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
def _is_edge(lidar: LidarConstants, a: float, b: float) -> bool:
    return bool(np.isfinite(a) and np.isfinite(b) and abs(a - b) > lidar.least_jump)


@inner_kernel
def _bias(lidar: LidarConstants, time_ns: int) -> float:
    """Range error of a device that is warming up."""
    if lidar.warm_up_bias == 0.0 or not lidar.noise:
        return 0.0
    bias: float = lidar.warm_up_bias * np.exp(-1e-9 * time_ns / lidar.warm_up_s)
    return bias


@inner_kernel
def _disturbed(
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
def _intensity(
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
        value *= np.power(float(cosine), lidar.incidence_exponent)
    if lidar.range_exponent != 0.0:
        far = max(distance, lidar.reference_range)
        value *= np.power(lidar.reference_range / far, lidar.range_exponent)
    if lidar.noise and lidar.brightness_noise > 0.0:
        value *= 1.0 + lidar.brightness_noise * normal(key, counter + 3)
    bounded: float = min(max(value, 0.0), lidar.brightest)
    return bounded


@inner_kernel
def _measure_single(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    bias: float,
    distance: NDArray[np.float32],
    cosine: NDArray[np.float32],
    material: NDArray[np.uint8],
    ranges: NDArray[np.float32],
    intensities: NDArray[np.float32],
) -> None:
    """One echo a beam: distances (beams,) to ranges (beams,) and intensities (0 or 1, beams)."""
    beams, stride = distance.shape[0], lidar.stride
    wanted = intensities.shape[0] > 0
    if not (lidar.noise or wanted):
        for i in range(beams):
            near = distance[i] < lidar.range_min
            ranges[i] = np.float32(-np.inf) if near else distance[i]
        return
    for i in range(beams):
        true = float(distance[i])
        r = true
        counter = (scan_number * beams + i) * _DRAWS
        if true < lidar.range_min:
            r = -np.inf
        elif lidar.noise and true < np.inf:
            if i + stride < beams and _is_edge(lidar, true, distance[i + stride]):
                gap = uniform(key, counter + 2)
                r = _beyond_edge(lidar, r, distance[i + stride], gap)
            if r == true and i >= stride and _is_edge(lidar, true, distance[i - stride]):
                gap = 1.0 - uniform(key, counter - stride * _DRAWS + 2)
                r = _beyond_edge(lidar, r, distance[i - stride], gap)
            r = _disturbed(lidar, r, true, cosine[i], bias, key, counter)
        ranges[i] = r
        if wanted:
            seen = abs(r) < np.inf
            intensities[0, i] = (
                _intensity(lidar, true, cosine[i], material[i], key, counter) if seen else 0.0
            )


@inner_kernel
def _shares(
    lidar: LidarConstants,
    key: np.uint64,
    counter: int,
    i: int,
    distance: NDArray[np.float32],
) -> tuple[float, float]:
    """Shares of a beam's footprint that lie beyond its edges to the next and the last beam."""
    stride = lidar.stride
    after = before = 0.0
    if i + stride < distance.shape[0] and _is_edge(lidar, distance[i], distance[i + stride]):
        gap = uniform(key, counter + 2)
        after = max(0.0, 0.5 * (1.0 - gap / lidar.half_footprint))
    if i >= stride and _is_edge(lidar, distance[i], distance[i - stride]):
        gap = 1.0 - uniform(key, counter - stride * _DRAWS + 2)
        before = max(0.0, 0.5 * (1.0 - gap / lidar.half_footprint))
    return after, before


@inner_kernel
def _merge(
    lidar: LidarConstants,
    place: NDArray[np.float64],
    share: NDArray[np.float64],
    source: NDArray[np.int64],
) -> int:
    """Sort the echoes by distance and merge those within a pulse length; how many are left."""
    for m in range(1, MOST_ECHOES):
        for n in range(m, 0, -1):
            if place[n] < place[n - 1]:
                place[n], place[n - 1] = place[n - 1], place[n]
                share[n], share[n - 1] = share[n - 1], share[n]
                source[n], source[n - 1] = source[n - 1], source[n]
    count = 0
    for m in range(MOST_ECHOES):
        if share[m] <= 0.0:
            continue
        last = count - 1
        if count > 0 and place[m] - place[last] < lidar.pulse_length:
            total = share[last] + share[m]
            place[last] += share[m] / total * (place[m] - place[last])
            if share[m] > share[last]:
                source[last] = source[m]
            share[last] = total
        else:
            place[count], share[count], source[count] = place[m], share[m], source[m]
            count += 1
    return count


@inner_kernel
def _measure_several(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    bias: float,
    distance: NDArray[np.float32],
    cosine: NDArray[np.float32],
    material: NDArray[np.uint8],
    ranges: NDArray[np.float32],
    intensities: NDArray[np.float32],
) -> None:
    """Up to E echoes a beam: distances (beams,) to ranges and intensities (E, beams).

    A footprint that reaches beyond an edge sends an echo from either side, each with its share of
    the light. Echoes within a pulse length are one; those with too small a share are not noticed.
    """
    beams, stride, most = distance.shape[0], lidar.stride, ranges.shape[0]
    place, share = np.empty(MOST_ECHOES), np.empty(MOST_ECHOES)
    source = np.empty(MOST_ECHOES, np.int64)
    for i in range(beams):
        ranges[:, i] = np.inf
        intensities[:, i] = 0.0
        true = float(distance[i])
        if true < lidar.range_min:
            ranges[0, i] = -np.inf
            continue
        if not true < np.inf:
            continue
        counter = (scan_number * beams + i) * _DRAWS
        after = before = 0.0
        if lidar.noise:
            after, before = _shares(lidar, key, counter, i, distance)
        place[0], share[0], source[0] = true, 1.0 - after - before, i
        place[1], share[1], source[1] = np.inf, after, i + stride
        place[2], share[2], source[2] = np.inf, before, i - stride
        for m in range(1, MOST_ECHOES):
            if share[m] > 0.0:
                place[m] = distance[source[m]]
        found = 0
        for m in range(_merge(lidar, place, share, source)):
            if share[m] < lidar.first_echo_share or found == most:
                continue
            j, r, own = source[m], place[m], key
            if m > 0:
                own = random_bits(key, _FIRST_ECHO_STREAM + m)
            if lidar.noise:
                r = _disturbed(lidar, r, r, cosine[j], bias, own, counter)
            if r < lidar.range_min or not r < np.inf:
                continue
            ranges[found, i] = r
            if intensities.shape[0] > 0:
                value = _intensity(lidar, place[m], cosine[j], material[j], own, counter)
                intensities[found, i] = share[m] * value
            found += 1


@inner_kernel
def measure(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    time_ns: int,
    scan: int,
    row: int,
    surfaces: Surfaces,
    echoes: Echoes,
) -> None:
    """Turn what a scan met (`row` of surfaces) into what it measures (row `scan` of echoes).

    `time_ns` is when the sweep began.
    """
    bias = _bias(lidar, time_ns)
    ranges, intensities = echoes.ranges[scan], echoes.intensities[scan]
    beams = ranges.shape[1]
    distance, cosine = surfaces.distance[row, :beams], surfaces.cosine[row, :beams]
    material = surfaces.material[row, :beams]
    if ranges.shape[0] == 1:
        _measure_single(
            lidar, key, scan_number, bias, distance, cosine, material, ranges[0], intensities
        )
    else:
        _measure_several(
            lidar, key, scan_number, bias, distance, cosine, material, ranges, intensities
        )


@kernel
def measure_scan(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    time_ns: int,
    scan: int,
    row: int,
    surfaces: Surfaces,
    echoes: Echoes,
) -> None:
    """`measure` for callers in Python."""
    measure(lidar, key, scan_number, time_ns, scan, row, surfaces, echoes)
