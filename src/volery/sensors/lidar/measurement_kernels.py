"""Compiled measurement of whole scans: from surfaces hit to ranges and intensities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel, owning_kernel
from volery.core.rng import random_bits, uniform
from volery.sensors.lidar.echo_kernels import (
    DRAWS,
    MAX_ECHOES,
    Echoes,
    LidarConstants,
    Surfaces,
    beyond_edge,
    disturbed,
    echo_intensity,
    is_edge,
    warm_up_bias,
)

_FIRST_ECHO_STREAM = 1 << 62
"""First draw number whose value is the key of an echo's own stream."""


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
    """Measures one echo per beam: distances (beams,) to ranges and intensities (0 or 1, beams)."""
    beams, stride = distance.shape[0], lidar.stride
    wanted = intensities.shape[0] > 0
    if not (lidar.noise or wanted):
        for i in range(beams):
            near = distance[i] < lidar.range_min
            ranges[i] = np.float32(-np.inf) if near else distance[i]
        return
    for i in range(beams):
        true: float = np.float64(distance[i])
        r: float = true
        counter = (scan_number * beams + i) * DRAWS
        if true < lidar.range_min:
            r = -np.inf
        elif lidar.noise and true < np.inf:
            if i + stride < beams and is_edge(lidar, true, distance[i + stride]):
                gap = uniform(key, counter + 2)
                r = beyond_edge(lidar, r, distance[i + stride], gap)
            if r == true and i >= stride and is_edge(lidar, true, distance[i - stride]):
                gap = 1.0 - uniform(key, counter - stride * DRAWS + 2)
                r = beyond_edge(lidar, r, distance[i - stride], gap)
            r = disturbed(lidar, r, true, cosine[i], bias, key, counter)
        ranges[i] = r
        if wanted:
            seen = abs(r) < np.inf
            intensities[0, i] = (
                echo_intensity(lidar, true, cosine[i], material[i], key, counter) if seen else 0.0
            )


@inner_kernel
def _fractions(
    lidar: LidarConstants,
    key: np.uint64,
    counter: int,
    i: int,
    distance: NDArray[np.float32],
) -> tuple[float, float]:
    """Returns the fractions of a footprint beyond the edges to the next and the last beam."""
    stride = lidar.stride
    after = before = 0.0
    if i + stride < distance.shape[0] and is_edge(lidar, distance[i], distance[i + stride]):
        gap = uniform(key, counter + 2)
        after = max(0.0, 0.5 * (1.0 - gap / lidar.half_footprint))
    if i >= stride and is_edge(lidar, distance[i], distance[i - stride]):
        gap = 1.0 - uniform(key, counter - stride * DRAWS + 2)
        before = max(0.0, 0.5 * (1.0 - gap / lidar.half_footprint))
    return after, before


@inner_kernel
def _merge(
    lidar: LidarConstants,
    echo_distance: NDArray[np.float64],
    fraction: NDArray[np.float64],
    source: NDArray[np.int64],
) -> int:
    """Sorts echoes by distance and merges those within a pulse length; returns the number left."""
    for m in range(1, MAX_ECHOES):
        for n in range(m, 0, -1):
            if echo_distance[n] < echo_distance[n - 1]:
                echo_distance[n], echo_distance[n - 1] = echo_distance[n - 1], echo_distance[n]
                fraction[n], fraction[n - 1] = fraction[n - 1], fraction[n]
                source[n], source[n - 1] = source[n - 1], source[n]
    count = 0
    for m in range(MAX_ECHOES):
        if fraction[m] <= 0.0:
            continue
        last = count - 1
        if count > 0 and echo_distance[m] - echo_distance[last] < lidar.pulse_length:
            total = fraction[last] + fraction[m]
            echo_distance[last] += fraction[m] / total * (echo_distance[m] - echo_distance[last])
            if fraction[m] > fraction[last]:
                source[last] = source[m]
            fraction[last] = total
        else:
            echo_distance[count], fraction[count], source[count] = (
                echo_distance[m],
                fraction[m],
                source[m],
            )
            count += 1
    return count


@owning_kernel
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
    """Measures up to E echoes per beam: distances (beams,) to ranges and intensities (E, beams).

    A footprint that extends beyond an edge returns an echo from either side, each with its fraction
    of the light. Echoes within a pulse length merge; those with too small a fraction are lost.
    """
    beams, stride, num_echoes = distance.shape[0], lidar.stride, ranges.shape[0]
    echo_distance, fraction = np.empty(MAX_ECHOES), np.empty(MAX_ECHOES)
    source = np.empty(MAX_ECHOES, np.int64)
    for i in range(beams):
        ranges[:, i] = np.inf
        intensities[:, i] = 0.0
        true: float = np.float64(distance[i])
        if true < lidar.range_min:
            ranges[0, i] = -np.inf
            continue
        if not true < np.inf:
            continue
        counter = (scan_number * beams + i) * DRAWS
        after = before = 0.0
        if lidar.noise:
            after, before = _fractions(lidar, key, counter, i, distance)
        echo_distance[0], fraction[0], source[0] = true, 1.0 - after - before, i
        echo_distance[1], fraction[1], source[1] = np.inf, after, i + stride
        echo_distance[2], fraction[2], source[2] = np.inf, before, i - stride
        for m in range(1, MAX_ECHOES):
            if fraction[m] > 0.0:
                echo_distance[m] = distance[source[m]]
        found = 0
        for m in range(_merge(lidar, echo_distance, fraction, source)):
            if fraction[m] < lidar.first_echo_share or found == num_echoes:
                continue
            j, r, own = source[m], echo_distance[m], key
            if m > 0:
                own = random_bits(key, _FIRST_ECHO_STREAM + m)
            if lidar.noise:
                r = disturbed(lidar, r, r, cosine[j], bias, own, counter)
            if r < lidar.range_min or not r < np.inf:
                continue
            ranges[found, i] = r
            if intensities.shape[0] > 0:
                value = echo_intensity(
                    lidar, echo_distance[m], cosine[j], material[j], own, counter
                )
                intensities[found, i] = fraction[m] * value
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
    """Turns a scan's hits (`row` of surfaces) into measurements (row `scan` of echoes).

    `time_ns` is the start of the sweep.
    """
    bias = warm_up_bias(lidar, time_ns)
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
    """Calls `measure` from Python."""
    measure(lidar, key, scan_number, time_ns, scan, row, surfaces, echoes)
