"""Compiled effect of rain, snow, fog or dust on scans: lost and false echoes.

Scans are processed after they were measured in clear air, with numbers from separate streams:
without particles nothing changes and nothing is computed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import normal, random_bits, uniform
from volery.core.workers import fetch_add
from volery.sensors.lidar.aim_kernels import RayBatch
from volery.sensors.lidar.echo_kernels import MAX_ECHOES, Echoes, LidarConstants
from volery.sensors.lidar.particle_echoes import KINDS, VOLUME, ParticleTable

_STREAM = 1 << 61
"""Number of the draw of a scan's stream whose value is the key of its particles."""
_DRAWS = MAX_ECHOES + 3 * KINDS
"""Draws per beam: survival of each echo; position, strength and noise of each kind's false one."""


@inner_kernel
def _weaken(
    lidar: LidarConstants,
    air: ParticleTable,
    i: int,
    key: np.uint64,
    counter: int,
    ranges: NDArray[np.float32],
    intensities: NDArray[np.float32],
) -> None:
    """Removes the echoes of beam `i` that are now too weak; the others move up."""
    kept = 0
    for m in range(ranges.shape[0]):
        r: float = np.float64(ranges[m, i])
        if not abs(r) < np.inf:
            continue
        brightness = intensities[m, i] if intensities.shape[0] > 0 else np.float32(0.0)
        alike = r * np.exp(air.extinction * r)
        ranges[m, i] = np.inf
        if intensities.shape[0] > 0:
            intensities[m, i] = 0.0
        if alike > lidar.range_max:
            continue
        if lidar.noise:
            before, now = r / lidar.range_max, alike / lidar.range_max
            still = 1.0 - lidar.dropout_far * now * now
            if uniform(key, counter + m) > still / (1.0 - lidar.dropout_far * before * before):
                continue
        ranges[kept, i] = r
        if intensities.shape[0] > 0:
            intensities[kept, i] = brightness * np.exp(-2.0 * air.extinction * r)
        kept += 1


@inner_kernel
def _table_index(table: NDArray[np.float64], events: float) -> float:
    """Returns the fractional index at which an ascending table reaches `events`."""
    low, high = 0, table.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle] <= events:
            low = middle
        else:
            high = middle
    return float(low + (events - table[low]) / max(table[high] - table[low], 1e-300))


@inner_kernel
def _between(values: NDArray[np.float64], index: float) -> float:
    low = min(int(index), values.shape[0] - 2)
    f = index - low
    return float((1.0 - f) * values[low] + f * values[low + 1])


@inner_kernel
def _insert(
    i: int,
    r: float,
    brightness: float,
    ranges: NDArray[np.float32],
    intensities: NDArray[np.float32],
) -> None:
    """Inserts an echo among those of beam `i` by range; the farthest of too many is dropped."""
    m = ranges.shape[0] - 1
    if not r < ranges[m, i]:
        return
    while m > 0 and r < ranges[m - 1, i]:
        ranges[m, i] = ranges[m - 1, i]
        if intensities.shape[0] > 0:
            intensities[m, i] = intensities[m - 1, i]
        m -= 1
    ranges[m, i] = r
    if intensities.shape[0] > 0:
        intensities[m, i] = brightness


@inner_kernel
def _see_particles(
    lidar: LidarConstants,
    air: ParticleTable,
    i: int,
    surface: float,
    key: np.uint64,
    counter: int,
    ranges: NDArray[np.float32],
    intensities: NDArray[np.float32],
) -> None:
    """Adds the first false echo of each kind in front of the `surface` that beam `i` hits.

    It needs the fraction of all light that any echo needs to be detected.
    """
    behind = 0.0
    if ranges[0, i] < np.inf:
        first: float = np.float64(ranges[0, i])
        alike = first * np.exp(air.extinction * first)
        behind = (lidar.range_max / alike) ** 2
    for kind in range(KINDS):
        draw = counter + MAX_ECHOES + 3 * kind
        drawn = uniform(key, draw)
        if drawn <= air.never[kind]:
            continue
        index = _table_index(air.events[kind], -np.log(drawn))
        r = _between(air.range, index)
        if r > surface - lidar.pulse_length:
            continue
        strength = 1.0 - _between(air.spread[kind], index) * np.log(uniform(key, draw + 1))
        if kind != VOLUME:
            strength *= strength
        if strength < lidar.first_echo_share * (strength + behind):
            continue
        shine = air.brightness * strength * (r / lidar.range_max) ** 2
        if lidar.range_exponent != 0.0:
            near = lidar.reference_range / max(r, lidar.reference_range)
            shine *= near**lidar.range_exponent
        sigma = max(lidar.noise_floor, lidar.noise_slope * r + lidar.noise_offset)
        r += sigma * normal(key, draw + 2)
        r = lidar.resolution * np.floor(r / lidar.resolution + 0.5)
        if r >= lidar.range_min:
            _insert(i, r, min(shine, lidar.brightest), ranges, intensities)


@kernel
def weather_scans(
    lidar: LidarConstants,
    air: ParticleTable,
    batch: RayBatch,
    counter: NDArray[np.int64],
    echoes: Echoes,
) -> None:
    """Applies particles to whole scans, numbered by `counter`; runs in every thread.

    A LIDAR without noise loses echoes beyond its reduced range, and sees no particles.
    """
    beams = echoes.ranges.shape[2]
    while True:
        scan = fetch_add(counter.ctypes.data)
        if scan >= echoes.ranges.shape[0]:
            return
        ranges, intensities = echoes.ranges[scan], echoes.intensities[scan]
        key = random_bits(batch.key[scan], _STREAM)
        for i in range(beams):
            if ranges[0, i] == -np.inf:
                continue
            number = (batch.scan_number[scan] * beams + i) * _DRAWS
            surface: float = np.float64(ranges[0, i])
            _weaken(lidar, air, i, key, number, ranges, intensities)
            if lidar.noise:
                _see_particles(lidar, air, i, surface, key, number, ranges, intensities)
