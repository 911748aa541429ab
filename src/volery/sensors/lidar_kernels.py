"""Compiled LIDAR: each beam from the pose it had, then what the electronics make of its echo.

The sensor's pose is looked up in the fleet's history every LANES beams; between them origin and
axes are interpolated. All random numbers come from the scan's stream, numbered by scan and beam, so
a scan does not depend on its batch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import normal, uniform
from volery.core.workers import fetch_add
from volery.sensors.mount import Mount, sensor_attitude
from volery.vehicle.pose_history import PoseHistory, pose_at
from volery.world.embree import DIRECTION, FAR, LANES, NORMAL, ORIGIN
from volery.world.scene_kernels import RayBlock, SceneHandle, cast_block, near_bodies

_CURVE_MARGIN_M = 0.5
"""How far a sensor may stray in a sweep from the box of its first and last position."""
_DRAWS = 4
"""Random numbers reserved for a beam: range, dropout, edge, one spare."""


class MountTable(NamedTuple):
    """Mounts in rows; see `Mount`."""

    position_body: NDArray[np.float64]
    """(M, 3)."""
    attitude_body: NDArray[np.float64]
    """(M, 4)."""
    nodding: NDArray[np.float64]
    """(M, 4) amplitude_rad, period_s, offset_rad, phase_rad."""


class LidarBatch(NamedTuple):
    """S scans to be made at once."""

    uav: NDArray[np.int64]
    """(S,) row of the UAV in history and scene."""
    mount: NDArray[np.int64]
    """(S,) row in `mounts`."""
    sweep_start_ns: NDArray[np.int64]
    """(S,) time of the first beam."""
    key: NDArray[np.uint64]
    """(S,) stream key of the sensor (core.rng.stream_key)."""
    scan_number: NDArray[np.int64]
    """(S,) number of the scan, counted from 0 by its sensor."""
    mounts: MountTable


class LidarConstants(NamedTuple):
    """A LIDAR model for kernels."""

    cosine: NDArray[np.float64]
    """(beams,) of the beam's angle."""
    sine: NDArray[np.float64]
    """(beams,)."""
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
    noise: bool


@inner_kernel
def sensor_frame(
    batch: LidarBatch, scan: int, history: PoseHistory, time_ns: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Origin, x axis and y axis of the sensor in the map at a time."""
    row = batch.mount[scan]
    mounts = batch.mounts
    mount = Mount(
        mounts.position_body[row],
        mounts.attitude_body[row],
        mounts.nodding[row, 0],
        mounts.nodding[row, 1],
        mounts.nodding[row, 2],
        mounts.nodding[row, 3],
    )
    x, y, z, px, py, pz, pw = pose_at(history, batch.uav[scan], time_ns)
    qx, qy, qz, qw = sensor_attitude(mount, time_ns)
    # The mount's position, turned into the map.
    mx, my, mz = mount.position_body[0], mount.position_body[1], mount.position_body[2]
    tx = 2.0 * (py * mz - pz * my)
    ty = 2.0 * (pz * mx - px * mz)
    tz = 2.0 * (px * my - py * mx)
    x += mx + pw * tx + py * tz - pz * ty
    y += my + pw * ty + pz * tx - px * tz
    z += mz + pw * tz + px * ty - py * tx
    # Map from sensor.
    ax = pw * qx + px * qw + py * qz - pz * qy
    ay = pw * qy - px * qz + py * qw + pz * qx
    az = pw * qz + px * qy - py * qx + pz * qw
    aw = pw * qw - px * qx - py * qy - pz * qz
    return (
        x,
        y,
        z,
        1.0 - 2.0 * (ay * ay + az * az),
        2.0 * (ax * ay + az * aw),
        2.0 * (ax * az - ay * aw),
        2.0 * (ax * ay - az * aw),
        1.0 - 2.0 * (ax * ax + az * az),
        2.0 * (ay * az + ax * aw),
    )


@inner_kernel
def beam_time_ns(lidar: LidarConstants, beam: int) -> int:
    """Time of a beam after the first one."""
    return int(lidar.sweep_ns * beam / (lidar.cosine.shape[0] - 1))


@inner_kernel
def aim_beams(
    lidar: LidarConstants,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    rays: NDArray[np.float32],
) -> None:
    """Fill packets (P, PACKET_ROWS, LANES) with a scan's origins and directions.

    The sensor's frame is looked up every LANES beams and interpolated between.
    """
    cosine, sine = lidar.cosine, lidar.sine
    beams = cosine.shape[0]
    start = batch.sweep_start_ns[scan]
    a = sensor_frame(batch, scan, history, start)
    for p in range((beams + LANES - 1) // LANES):
        first = p * LANES
        last = min(first + LANES, beams - 1)
        b = sensor_frame(batch, scan, history, start + beam_time_ns(lidar, last))
        step = 1.0 / max(last - first, 1)
        for k in range(min(LANES, beams - first)):
            i = first + k
            f = k * step
            g = 1.0 - f
            c, s = cosine[i], sine[i]
            dx = c * (g * a[3] + f * b[3]) + s * (g * a[6] + f * b[6])
            dy = c * (g * a[4] + f * b[4]) + s * (g * a[7] + f * b[7])
            dz = c * (g * a[5] + f * b[5]) + s * (g * a[8] + f * b[8])
            # Within a packet the axes turn by milliradians, so the length is 1 but for some 1e-6:
            # one Newton step for 1 / sqrt sets it right.
            unit = 1.5 - 0.5 * (dx * dx + dy * dy + dz * dz)
            rays[p, ORIGIN, k] = g * a[0] + f * b[0]
            rays[p, ORIGIN + 1, k] = g * a[1] + f * b[1]
            rays[p, ORIGIN + 2, k] = g * a[2] + f * b[2]
            rays[p, DIRECTION, k] = dx * unit
            rays[p, DIRECTION + 1, k] = dy * unit
            rays[p, DIRECTION + 2, k] = dz * unit
        a = b


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
def measure(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    cosine: NDArray[np.float32],
    ranges: NDArray[np.float32],
) -> None:
    """Turn true distances (beams,) into measured ranges, in place.

    `cosine` holds the cosine of incidence of each beam. Result: m; inf no echo, -inf too near.
    """
    beams = ranges.shape[0]
    before = np.inf
    for i in range(beams):
        true = float(ranges[i])
        r = true
        if true < lidar.range_min:
            r = -np.inf
        elif lidar.noise and true < np.inf:
            counter = (scan_number * beams + i) * _DRAWS
            if i + 1 < beams and _is_edge(lidar, true, ranges[i + 1]):
                gap = uniform(key, counter + 2)
                r = _beyond_edge(lidar, r, ranges[i + 1], gap)
            if r == true and _is_edge(lidar, true, before):
                gap = 1.0 - uniform(key, counter - _DRAWS + 2)
                r = _beyond_edge(lidar, r, before, gap)
            sigma = max(lidar.noise_floor, lidar.noise_slope * r + lidar.noise_offset)
            r += sigma * normal(key, counter)
            r = lidar.resolution * np.floor(r / lidar.resolution + 0.5)
            if _dropped(lidar, true, cosine[i], uniform(key, counter + 1)) or r > lidar.range_max:
                r = np.inf
            elif r < lidar.range_min:
                r = -np.inf
        ranges[i] = r
        before = true


@inner_kernel
def _near_scan(
    scene: SceneHandle,
    lidar: LidarConstants,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    near: NDArray[np.int32],
) -> int:
    """List the other UAVs within reach during the sweep; their number."""
    if scene.bodies.scene.shape[0] == 0:
        return 0
    start = batch.sweep_start_ns[scan]
    a = sensor_frame(batch, scan, history, start)
    b = sensor_frame(batch, scan, history, start + lidar.sweep_ns)
    m = _CURVE_MARGIN_M
    count = near_bodies(
        scene.bodies,
        (min(a[0], b[0]) - m, min(a[1], b[1]) - m, min(a[2], b[2]) - m),
        (max(a[0], b[0]) + m, max(a[1], b[1]) + m, max(a[2], b[2]) + m),
        lidar.range_max,
        near,
    )
    kept = 0
    for n in range(count):
        if near[n] != batch.uav[scan]:
            near[kept] = near[n]
            kept += 1
    return kept


@kernel
def scan_batch(
    scene: SceneHandle,
    lidar: LidarConstants,
    batch: LidarBatch,
    history: PoseHistory,
    bodies_start_ns: int,
    bodies_end_ns: int,
    counter: NDArray[np.int64],
    block: RayBlock,
    memory: NDArray[np.float32],
    ranges: NDArray[np.float32],
) -> None:
    """Make whole scans, taken one by one from `counter`; `ranges` is (S, beams).

    `block` holds a scan's rays, `memory` is (2, P * LANES).
    """
    beams = lidar.cosine.shape[0]
    rays, instance = block.rays, block.instance
    found, cosine = memory[0], memory[1]
    interval = max(bodies_end_ns - bodies_start_ns, 1)
    while True:
        scan = fetch_add(counter.ctypes.data)
        if scan >= batch.uav.shape[0]:
            return
        near_count = _near_scan(scene, lidar, batch, scan, history, block.near)
        aim_beams(lidar, batch, scan, history, rays)
        for packet in range(block.fraction.shape[0]):
            time = batch.sweep_start_ns[scan] + beam_time_ns(lidar, _middle(packet, beams))
            fraction = (time - bodies_start_ns) / interval
            block.fraction[packet] = min(max(fraction, 0.0), 1.0)
        cast_block(scene, block, beams, lidar.range_max, near_count)
        for p in range(rays.shape[0]):
            for k in range(LANES):
                x, y, z = rays[p, NORMAL, k], rays[p, NORMAL + 1, k], rays[p, NORMAL + 2, k]
                along = (
                    x * rays[p, DIRECTION, k]
                    + y * rays[p, DIRECTION + 1, k]
                    + z * rays[p, DIRECTION + 2, k]
                )
                squared = max(x * x + y * y + z * z, np.float32(1e-30))
                cosine[p * LANES + k] = abs(along) / np.sqrt(squared)
                hit = instance[p, k] >= 0
                found[p * LANES + k] = rays[p, FAR, k] if hit else np.float32(np.inf)
        out = ranges[scan]
        for i in range(beams):
            out[i] = found[i]
        measure(lidar, batch.key[scan], batch.scan_number[scan], cosine, out)


@inner_kernel
def _middle(packet: int, beams: int) -> int:
    """The beam at whose time a packet sees the other UAVs."""
    return min(packet * LANES + LANES // 2, beams - 1)


@kernel
def sweep_rays(
    lidar: LidarConstants,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    packets: NDArray[np.float32],
    rays: NDArray[np.float32],
    times_ns: NDArray[np.int64],
) -> None:
    """Beams of one scan (6, beams) and when they see the others, for a caster in Python."""
    beams = lidar.cosine.shape[0]
    aim_beams(lidar, batch, scan, history, packets)
    for i in range(beams):
        for j in range(3):
            rays[j, i] = packets[i // LANES, ORIGIN + j, i % LANES]
            rays[3 + j, i] = packets[i // LANES, DIRECTION + j, i % LANES]
    for i in range(beams):
        beam = _middle(i // LANES, beams)
        times_ns[i] = batch.sweep_start_ns[scan] + beam_time_ns(lidar, beam)


@kernel
def measure_scan(
    lidar: LidarConstants,
    key: np.uint64,
    scan_number: int,
    cosine: NDArray[np.float32],
    ranges: NDArray[np.float32],
) -> None:
    """`measure` for callers in Python."""
    measure(lidar, key, scan_number, cosine, ranges)


@kernel
def poses_at(
    history: PoseHistory,
    time_ns: int,
    position: NDArray[np.float64],
    attitude: NDArray[np.float64],
) -> None:
    """Poses (N, 3), (N, 4) of all UAVs at a time."""
    for i in range(position.shape[0]):
        x, y, z, qx, qy, qz, qw = pose_at(history, i, time_ns)
        position[i, 0], position[i, 1], position[i, 2] = x, y, z
        attitude[i, 0], attitude[i, 1], attitude[i, 2], attitude[i, 3] = qx, qy, qz, qw
