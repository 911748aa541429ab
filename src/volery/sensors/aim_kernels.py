"""Compiled aiming of LIDARs: each ray from the pose that its sensor had at the ray's own time.

The sensor's pose is looked up in the fleet's history at the knots of each packet of rays; between
them origin and axes are interpolated.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.sensors.beam_table import TABLE_ROWS, BeamTable
from volery.sensors.mount import Mount, sensor_attitude
from volery.vehicle.pose_history import PoseHistory, pose_at
from volery.world.embree import DIRECTION, LANES, ORIGIN, PACKET_ROWS

_LONGEST_CHORD_NS = 2_000_000
"""Packets that last longer have the pose looked up for every ray.

In 2 ms a UAV that turns at 10 rad/s turns by .02 rad, and the mean of two axes is short by 5e-5 at
most, which one Newton step for 1 / sqrt sets right.
"""

Frame: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]


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


@inner_kernel
def sensor_frame(batch: LidarBatch, scan: int, history: PoseHistory, time_ns: int) -> Frame:
    """Origin, x axis, y axis and z axis of the sensor in the map at a time."""
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
        2.0 * (ax * az + ay * aw),
        2.0 * (ay * az - ax * aw),
        1.0 - 2.0 * (ax * ax + ay * ay),
    )


@inner_kernel
def aim_packets(
    table: BeamTable,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    first: int,
    count: int,
    rays: NDArray[np.float32],
) -> None:
    """Fill packets (P, PACKET_ROWS, LANES) with `count` packets of a scan from packet `first` on.

    Neighbouring packets often share knots; what is known already is not looked up again.
    """
    start = batch.sweep_start_ns[scan]
    # Flat slices with constant offsets: only so the compiler sees that nothing overlaps, and makes
    # vectors of the loop over the lanes.
    aims, out = table.lanes.reshape(table.lanes.size), rays.reshape(rays.size)
    knots = table.knot_ns[first:]
    a_ns = b_ns = knots[0, 0]
    a = b = sensor_frame(batch, scan, history, start + a_ns)
    for p in range(count):
        if knots[p, 0] != a_ns:
            a_ns = knots[p, 0]
            a = b if a_ns == b_ns else sensor_frame(batch, scan, history, start + a_ns)
        if knots[p, 1] != b_ns:
            b_ns = knots[p, 1]
            b = sensor_frame(batch, scan, history, start + b_ns)
        if b_ns - a_ns > _LONGEST_CHORD_NS:
            _aim_one_by_one(table, batch, scan, history, first + p, rays[p])
            continue
        q = first + p
        aim = aims[q * TABLE_ROWS * LANES : (q + 1) * TABLE_ROWS * LANES]
        ray = out[p * PACKET_ROWS * LANES : (p + 1) * PACKET_ROWS * LANES]
        for k in range(LANES):
            c, s, u, f = aim[k], aim[LANES + k], aim[2 * LANES + k], aim[3 * LANES + k]
            g = 1.0 - f
            dx = c * (g * a[3] + f * b[3]) + s * (g * a[6] + f * b[6]) + u * (g * a[9] + f * b[9])
            dy = c * (g * a[4] + f * b[4]) + s * (g * a[7] + f * b[7]) + u * (g * a[10] + f * b[10])
            dz = c * (g * a[5] + f * b[5]) + s * (g * a[8] + f * b[8]) + u * (g * a[11] + f * b[11])
            unit = 1.5 - 0.5 * (dx * dx + dy * dy + dz * dz)
            ray[ORIGIN * LANES + k] = g * a[0] + f * b[0]
            ray[(ORIGIN + 1) * LANES + k] = g * a[1] + f * b[1]
            ray[(ORIGIN + 2) * LANES + k] = g * a[2] + f * b[2]
            ray[DIRECTION * LANES + k] = dx * unit
            ray[(DIRECTION + 1) * LANES + k] = dy * unit
            ray[(DIRECTION + 2) * LANES + k] = dz * unit


@inner_kernel
def _aim_one_by_one(
    table: BeamTable,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    packet: int,
    rays: NDArray[np.float32],
) -> None:
    """Fill one packet (PACKET_ROWS, LANES), looking the pose up for every ray."""
    start, end = table.knot_ns[packet, 0], table.knot_ns[packet, 1]
    for k in range(LANES):
        aim = table.lanes[packet]
        c, s, u, f = aim[0, k], aim[1, k], aim[2, k], aim[3, k]
        after = start + round(f * (end - start))
        frame = sensor_frame(batch, scan, history, batch.sweep_start_ns[scan] + after)
        for j in range(3):
            rays[ORIGIN + j, k] = frame[j]
            rays[DIRECTION + j, k] = c * frame[3 + j] + s * frame[6 + j] + u * frame[9 + j]


@kernel
def sweep_rays(
    table: BeamTable,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    packets: NDArray[np.float32],
    rays: NDArray[np.float32],
    times_ns: NDArray[np.int64],
) -> None:
    """Beams of one scan (6, beams) and when they see the others, for a caster in Python."""
    aim_packets(table, batch, scan, history, 0, packets.shape[0], packets)
    for r in range(table.rays):
        i = table.beam[r]
        for j in range(3):
            rays[j, i] = packets[r // LANES, ORIGIN + j, r % LANES]
            rays[3 + j, i] = packets[r // LANES, DIRECTION + j, r % LANES]
        times_ns[i] = batch.sweep_start_ns[scan] + table.seen_ns[r // LANES]


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
