"""Compiled rendering: rays of pixels are aimed, cast and shaded in pieces that threads share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import random_bits
from volery.core.workers import fetch_add
from volery.sensors.cameras.hit_kernels import Scratch, new_scratch, note_hits
from volery.sensors.cameras.light import CODES, Light
from volery.sensors.cameras.pixel_table import PIECE, PixelTable
from volery.sensors.cameras.shade_kernels import shade
from volery.sensors.cameras.shadow_kernels import find_shadows, shading_bodies
from volery.sensors.lidar.aim_kernels import RayBatch, sensor_frame
from volery.vehicle.pose_history import PoseHistory
from volery.world.body_kernels import body_sphere
from volery.world.embree import DIRECTION, FAR, LANES, ORIGIN
from volery.world.scene_kernels import RayBlock, SceneHandle, cast_block, near_bodies
from volery.world.world_kernels import own_world

NORMALS = 4096
"""Size of the table of normal numbers; the largest is 3.7 standard deviations."""

f4 = np.float32
_LAST = np.uint64(NORMALS - 1)
_CHANNEL_BITS, _DEPTH_BITS = np.uint64(12), np.uint64(36)
"""Bits of a pixel's random number: three channels and the depth use twelve each."""


class Frames(NamedTuple):
    """Output arrays of S images; arrays without pixels are not written."""

    colour: NDArray[np.uint8]
    """(S, height * width, 3) sRGB, or (S, 0, 3)."""
    depth: NDArray[np.float32]
    """(S, height * width) m along the optical axis; -inf too near, inf too far; or (S, 0)."""
    instance: NDArray[np.int32]
    """(S, height * width) scene instance, -1 for none; or (S, 0)."""
    material: NDArray[np.uint8]
    """(S, height * width) `Material`; or (S, 0)."""


class Optics(NamedTuple):
    """Parameters of a camera for kernels."""

    near_m: float
    far_m: float
    max_range_m: float
    """Length of the longest ray: to depth `far_m` in the image's corner."""
    readout_ns: int
    exposure: float
    read_noise: float
    shot_noise: float
    depth_noise_per_m: float
    normals: NDArray[np.float32]
    """(NORMALS,) normal numbers that noise is drawn from."""


@inner_kernel
def _aim(
    table: PixelTable,
    batch: RayBatch,
    shot: int,
    history: PoseHistory,
    first: int,
    count: int,
    block: RayBlock,
) -> None:
    """Fills `block` with the rays of `count` packets of an image, from packet `first` on."""
    known_ns = np.int64(-1)
    frame = sensor_frame(batch, shot, history, batch.sweep_start_ns[shot])
    for p in range(count):
        after_ns = table.after_ns[first + p]
        if after_ns != known_ns:
            known_ns = after_ns
            frame = sensor_frame(batch, shot, history, batch.sweep_start_ns[shot] + after_ns)
        rays, aims = block.rays[p], table.direction[first + p]
        for k in range(LANES):
            f, s, u = aims[0, k], aims[1, k], aims[2, k]
            for j in range(3):
                rays[ORIGIN + j, k] = frame[j]
                rays[DIRECTION + j, k] = f * frame[3 + j] + s * frame[6 + j] + u * frame[9 + j]
            block.skip[p, k] = -1


@inner_kernel
def _near(
    scene: SceneHandle,
    table: PixelTable,
    batch: RayBatch,
    shot: int,
    piece: int,
    history: PoseHistory,
    optics: Optics,
    near: NDArray[np.int32],
) -> int:
    """Lists in `near` the other UAVs that a piece of the image may show; returns their number."""
    bodies = scene.bodies
    if bodies.scene.shape[0] == 0:
        return 0
    start = batch.sweep_start_ns[shot]
    a = sensor_frame(batch, shot, history, start)
    b = sensor_frame(batch, shot, history, start + optics.readout_ns)
    count = near_bodies(
        bodies,
        (min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])),
        (max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])),
        optics.max_range_m,
        batch.uav[shot],
        near,
    )
    cone = table.cone[piece]
    x = cone[0] * a[3] + cone[1] * a[6] + cone[2] * a[9]
    y = cone[0] * a[4] + cone[1] * a[7] + cone[2] * a[10]
    z = cone[0] * a[5] + cone[1] * a[8] + cone[2] * a[11]
    kept = 0
    for n in range(count):
        cx, cy, cz, radius = body_sphere(bodies, near[n])
        dx, dy, dz = cx - a[0], cy - a[1], cz - a[2]
        away = np.sqrt(dx * dx + dy * dy + dz * dz)
        if away > radius:
            sine = radius / away
            edge = cone[3] * np.sqrt(1.0 - sine * sine) - cone[4] * sine
            if dx * x + dy * y + dz * z < edge * away:
                continue
        near[kept] = near[n]
        kept += 1
    return kept


@inner_kernel
def _first_number(table: PixelTable, batch: RayBatch, shot: int) -> int:
    """Returns the index of an image's first random number; each pixel has one."""
    room = table.direction.shape[0] * LANES
    return int(batch.scan_number[shot] * room)


@inner_kernel
def _write_geometry(
    table: PixelTable,
    optics: Optics,
    batch: RayBatch,
    block: RayBlock,
    first: int,
    count: int,
    shot: int,
    frames: Frames,
) -> None:
    """Writes depth and labels of pixels, from the first sample of each."""
    wants_depth, wants_labels = frames.depth.shape[1] > 0, frames.instance.shape[1] > 0
    is_noisy = optics.depth_noise_per_m > 0.0
    normals, key, number = optics.normals, batch.key[shot], _first_number(table, batch, shot)
    near, far = f4(optics.near_m), f4(optics.far_m)
    for p in range(count):
        pixels, blinds = table.pixel[first + p], table.blind[first + p]
        ahead, rays, instance = table.direction[first + p], block.rays[p], block.instance[p]
        for k in range(0, LANES, table.samples):
            pixel = pixels[k]
            if pixel < 0:
                continue
            depth = rays[FAR, k] * ahead[0, k]
            seen = instance[k] >= 0 and depth <= far and not blinds[k]
            if wants_depth:
                if not seen:
                    depth = f4(np.nan) if blinds[k] else f4(np.inf)
                elif depth < near:
                    depth = f4(-np.inf)
                elif is_noisy:
                    drawn = normals[(random_bits(key, number + pixel) >> _DEPTH_BITS) & _LAST]
                    # Stereo noise acts on 1 / depth; where that becomes too small, depth is inf.
                    factor = f4(1.0) + f4(optics.depth_noise_per_m) * drawn * depth
                    depth = depth / factor if factor * far > depth else f4(np.inf)
                frames.depth[shot, pixel] = depth
            if wants_labels:
                frames.instance[shot, pixel] = instance[k] if seen else -1
                frames.material[shot, pixel] = block.material[p, k] if seen else 0


@inner_kernel
def _gather_light(
    colour: NDArray[np.float32], blinds: NDArray[np.bool_], samples: int, scale: Any
) -> None:
    """Turns a packet's linear colours into exposed pixel means, in the first lane of each pixel."""
    for j in range(3):
        for k in range(LANES):
            bounded = min(max(colour[j, k], f4(0.0)), f4(1e4))
            colour[j, k] = f4(0.0) if blinds[k] else bounded
        for k in range(0, LANES if samples > 1 else 0, samples):
            for n in range(1, samples):
                colour[j, k] += colour[j, k + n]
        for k in range(LANES):
            colour[j, k] *= scale


@inner_kernel
def _write_colour(
    table: PixelTable,
    optics: Optics,
    light: Light,
    batch: RayBatch,
    first: int,
    count: int,
    shot: int,
    colours: NDArray[np.float32],
    frames: Frames,
) -> None:
    """Writes the bytes of pixels, each the mean of its samples' light."""
    samples, codes, out = table.samples, light.code, frames.colour[shot]
    scale = f4(optics.exposure / samples)
    is_noisy = optics.read_noise > 0.0 or optics.shot_noise > 0.0
    dark, bright = f4(optics.read_noise**2), f4(optics.shot_noise**2)
    normals, key, number = optics.normals, batch.key[shot], _first_number(table, batch, shot)
    for p in range(count):
        colour, pixels = colours[p], table.pixel[first + p]
        _gather_light(colour, table.blind[first + p], samples, scale)
        for k in range(0, LANES if is_noisy else 0, samples):
            bits: Any = random_bits(key, number + pixels[k])
            for j in range(3):
                lit = colour[j, k]
                colour[j, k] += normals[bits & _LAST] * np.sqrt(dark + bright * min(lit, f4(1.0)))
                bits >>= _CHANNEL_BITS
        for j in range(3):
            for k in range(LANES):
                lit = min(max(colour[j, k], f4(0.0)), f4(1.0))
                colour[j, k] = lit * f4(CODES - 1) + f4(0.5)
        for k in range(0, LANES, samples):
            pixel = pixels[k]
            if pixel >= 0:
                out[pixel, 0] = codes[int(colour[0, k])]
                out[pixel, 1] = codes[int(colour[1, k])]
                out[pixel, 2] = codes[int(colour[2, k])]


@inner_kernel
def _render_piece(
    scene: SceneHandle,
    table: PixelTable,
    optics: Optics,
    light: Light,
    batch: RayBatch,
    shot: int,
    piece: int,
    history: PoseHistory,
    interval: tuple[int, int],
    block: RayBlock,
    scratch: Scratch,
    frames: Frames,
) -> None:
    """Renders a piece of an image; `interval` is that in which the bodies move, ns."""
    own_scene = own_world(scene, batch.uav[shot])
    first = piece * PIECE
    own = min(PIECE, table.direction.shape[0] - first)
    near_count = _near(own_scene, table, batch, shot, piece, history, optics, block.near)
    _aim(table, batch, shot, history, first, own, block)
    length = max(interval[1] - interval[0], 1)
    for p in range(own):
        time = batch.sweep_start_ns[shot] + table.after_ns[first + p]
        fraction = (time - interval[0]) / length
        block.fraction[p] = min(max(fraction, 0.0), 1.0)
    cast_block(own_scene, block, own * LANES, optics.max_range_m, near_count)
    _write_geometry(table, optics, batch, block, first, own, shot, frames)
    if frames.colour.shape[1] > 0:
        note_hits(block, own, scratch)
        near_count = shading_bodies(own_scene, batch.uav[shot], light, scratch, own, block.near)
        find_shadows(own_scene, block, own, near_count, light, scratch)
        shade(own_scene, block, own, light, scratch)
        _write_colour(table, optics, light, batch, first, own, shot, scratch.colour, frames)


@kernel
def render_images(
    scene: SceneHandle,
    table: PixelTable,
    optics: Optics,
    light: Light,
    batch: RayBatch,
    history: PoseHistory,
    bodies_start_ns: int,
    bodies_end_ns: int,
    counter: NDArray[np.int64],
    block: RayBlock,
    frames: Frames,
) -> None:
    """Renders pieces of images, numbered by `counter`, until none is left; runs in every thread.

    A piece is PIECE packets of one image. Rays start at the camera's pose at the exposure of their
    row, map frame; UAVs and actors move from `bodies_start_ns` to `bodies_end_ns`. `counter` (1,)
    is shared by all threads, `block` is the calling thread's memory. Results go to `frames`; its
    arrays without pixels are skipped.
    """
    packets = table.direction.shape[0]
    pieces = (packets + PIECE - 1) // PIECE
    interval = bodies_start_ns, bodies_end_ns
    scratch = new_scratch(PIECE if frames.colour.shape[1] > 0 else 0)
    while True:
        number = fetch_add(counter.ctypes.data)
        shot = number // pieces
        if shot >= batch.uav.shape[0]:
            return
        piece = number % pieces
        _render_piece(
            scene,
            table,
            optics,
            light,
            batch,
            shot,
            piece,
            history,
            interval,
            block,
            scratch,
            frames,
        )
