"""Compiled drawing of drops and flakes into rendered images.

Each particle is drawn as its streak while the shutter is open, camera motion included, and covers a
pixel's light by its fraction of the time and of the pixel (Garg and Nayar 2007, "Vision and rain").
Nearer surfaces hide particles.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import random_bits
from volery.core.workers import fetch_add
from volery.sensors.cameras.camera_kernels import Frames
from volery.sensors.cameras.light import CLEAR, CODES, Light
from volery.sensors.cameras.precipitation import Falling
from volery.sensors.lidar.aim_kernels import Frame, RayBatch, sensor_frame
from volery.vehicle.pose_history import PoseHistory

_NEAREST_M = 0.3
"""Minimum distance, m; nearer particles are an invisible blur."""
_FAINT = 3e-4
"""Fraction of a pixel's light below which nothing is drawn: the first byte above black."""
_FRACTION_BITS = np.uint64(16)
_FRACTION_MASK = np.uint64(0xFFFF)
_CELL_MASK = 0xFFFFFFFF

f4 = np.float32


class WeatherView(NamedTuple):
    """Camera parameters for drawing particles."""

    width: int
    height: int
    focal_px: float
    centre_px: tuple[float, float]
    distortion: NDArray[np.float64]
    """(5,) k1, k2, p1, p2, k3."""
    across: float
    """Largest lateral or vertical distance in view, per metre of depth."""
    exposure_ns: int
    """Time that the shutter is open, up to the image's time, ns."""
    exposure: float
    """Factor of the light."""
    linear: NDArray[np.float32]
    """(256,) linear light of each byte value."""


@inner_kernel
def _seen_at(
    view: WeatherView, frame: Frame, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Returns column, row and depth, m, of a point of the map; depth 0 or less: not in view."""
    dx, dy, dz = x - frame[0], y - frame[1], z - frame[2]
    ahead = dx * frame[3] + dy * frame[4] + dz * frame[5]
    if ahead < 0.5 * _NEAREST_M:
        return 0.0, 0.0, 0.0
    a = -(dx * frame[6] + dy * frame[7] + dz * frame[8]) / ahead
    b = -(dx * frame[9] + dy * frame[10] + dz * frame[11]) / ahead
    if abs(a) > 1.2 * view.across + 0.1 or abs(b) > 1.2 * view.across + 0.1:
        return 0.0, 0.0, 0.0
    k1, k2, p1, p2, k3 = view.distortion
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    column = a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
    row = b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
    focal, centre = view.focal_px, view.centre_px
    return centre[0] + focal * column, centre[1] + focal * row, ahead


@inner_kernel
def _draw(
    view: WeatherView,
    light: Light,
    particle: Falling,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    diameter_m: float,
    depth: NDArray[np.float32],
    colour: NDArray[np.uint8],
) -> None:
    """Blends a streak from `start` to `end` (column, row, depth) into an image (pixels, 3)."""
    along, down = end[0] - start[0], end[1] - start[1]
    length = np.sqrt(along * along + down * down)
    ahead = 0.5 * (start[2] + end[2])
    width = diameter_m * view.focal_px / ahead
    drawn = max(width, 1.0)
    quarter = 0.25 * np.pi
    # of the streak drawn below, including its soft edge, half a pixel wide
    area = drawn * length + quarter * drawn * drawn + np.pi / 12.0
    fraction = min(quarter * width * width / area, 1.0)
    if fraction < _FAINT:
        return
    step: Any = np.int64(ahead * light.clear_per_m)
    clear = light.clear[min(step, CLEAR - 1)]
    half = 0.5 * drawn
    first_row = max(int(np.floor(min(start[1], end[1]) - half)), 0)
    last_row = min(int(np.ceil(max(start[1], end[1]) + half)), view.height - 1)
    first_column = max(int(np.floor(min(start[0], end[0]) - half)), 0)
    last_column = min(int(np.ceil(max(start[0], end[0]) + half)), view.width - 1)
    inverse = 1.0 / max(length * length, 1e-12)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            x, y = column - start[0], row - start[1]
            part = min(max((x * along + y * down) * inverse, 0.0), 1.0)
            x -= part * along
            y -= part * down
            cover = fraction * min(half + 0.5 - np.sqrt(x * x + y * y), 1.0)
            pixel = row * view.width + column
            if cover < _FAINT or not depth[pixel] > ahead:
                continue
            for j in range(3):
                own = light.horizon[j] + clear * (particle.colour[j] - light.horizon[j])
                before = view.linear[colour[pixel, j]]
                lit = before + f4(cover) * (f4(view.exposure) * own - before)
                code = min(max(lit, f4(0.0)), f4(1.0)) * f4(CODES - 1) + f4(0.5)
                colour[pixel, j] = light.code[int(code)]


@inner_kernel
def _box(view: WeatherView, frame: Frame, max_range: float, j: int) -> tuple[float, float]:
    """Returns the minimum and maximum of coordinate `j` in view up to `max_range`, m, map frame."""
    aside = view.across * max_range * (abs(frame[6 + j]) + abs(frame[9 + j]))
    far = frame[j] + max_range * frame[3 + j]
    return min(frame[j], far - aside), max(frame[j], far + aside)


@inner_kernel
def _draw_all(
    view: WeatherView,
    light: Light,
    particle: Falling,
    before: Frame,
    now: Frame,
    time_ns: int,
    depth: NDArray[np.float32],
    colour: NDArray[np.uint8],
) -> None:
    """Draws all particles of a kind into one image, taken at `time_ns`."""
    cell, v = particle.cell_m, particle.velocity
    sx, sy, sz = v[0] * 1e-9 * time_ns, v[1] * 1e-9 * time_ns, v[2] * 1e-9 * time_ns
    open_s = 1e-9 * view.exposure_ns
    x0, x1 = _box(view, now, particle.max_range_m, 0)
    y0, y1 = _box(view, now, particle.max_range_m, 1)
    z0, z1 = _box(view, now, particle.max_range_m, 2)
    for i in range(int(np.floor((x0 - sx) / cell)), int(np.floor((x1 - sx) / cell)) + 1):
        plane = random_bits(particle.key, i & _CELL_MASK)
        for j in range(int(np.floor((y0 - sy) / cell)), int(np.floor((y1 - sy) / cell)) + 1):
            column = random_bits(plane, j & _CELL_MASK)
            low = int(np.floor((z0 - sz) / cell))
            for k in range(low, int(np.floor((z1 - sz) / cell)) + 1):
                bits = random_bits(column, k & _CELL_MASK)
                x = (i + float(bits & _FRACTION_MASK) / 65536.0) * cell + sx
                bits >>= _FRACTION_BITS
                y = (j + float(bits & _FRACTION_MASK) / 65536.0) * cell + sy
                bits >>= _FRACTION_BITS
                z = (k + float(bits & _FRACTION_MASK) / 65536.0) * cell + sz
                bits >>= _FRACTION_BITS
                end = _seen_at(view, now, x, y, z)
                if end[2] < _NEAREST_M or end[2] > particle.max_range_m:
                    continue
                start = _seen_at(
                    view, before, x - open_s * v[0], y - open_s * v[1], z - open_s * v[2]
                )
                if start[2] <= 0.0:
                    continue
                drawn = (float(bits & _FRACTION_MASK) + 0.5) / 65536.0
                diameter = particle.min_mm - np.log(drawn) / particle.slope
                _draw(view, light, particle, start, end, 1e-3 * diameter, depth, colour)


@kernel
def draw_falling(
    view: WeatherView,
    light: Light,
    particle: Falling,
    batch: RayBatch,
    history: PoseHistory,
    counter: NDArray[np.int64],
    frames: Frames,
) -> None:
    """Draws particles of one kind into whole images, numbered by `counter`; runs in every thread.

    `frames` must hold depth and colour. All rows of a rolling shutter count as exposed with the
    first.
    """
    while True:
        shot = fetch_add(counter.ctypes.data)
        if shot >= batch.uav.shape[0]:
            return
        time_ns = batch.sweep_start_ns[shot]
        before = sensor_frame(batch, shot, history, time_ns - view.exposure_ns)
        now = sensor_frame(batch, shot, history, time_ns)
        depth, colour = frames.depth[shot], frames.colour[shot]
        _draw_all(view, light, particle, before, now, time_ns, depth, colour)
