"""Compiled aiming of LIDARs: each ray starts from the sensor's pose at the ray's own time.

The sensor's pose is read from the fleet's history at the knots of each packet of rays; between the
knots, origin and axes are interpolated.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.rotation_kernels import matrix_rows, quaternion_product, rotate_vector
from volery.sensors.lidar.beam_table import TABLE_ROWS, BeamTable
from volery.sensors.mount import nodded, nodding_angle
from volery.vehicle.pose_history import PoseHistory, pose_at
from volery.world.embree import DIRECTION, LANES, ORIGIN, PACKET_ROWS

_LONGEST_CHORD_NS = 2_000_000
"""For longer packets the pose is read for every ray.

In 2 ms a UAV that turns at 10 rad/s turns by .02 rad, and the mean of two axes is too short by at
most 5e-5, which one Newton step for 1 / sqrt corrects.
"""

Frame: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]


class MountTable(NamedTuple):
    """Mounts of M sensors, one row each; see `Mount`."""

    position_body: NDArray[np.float64]
    """(M, 3) m, body frame FLU."""
    attitude_body: NDArray[np.float64]
    """(M, 4) unit quaternions x y z w, body from sensor."""
    nodding: NDArray[np.float64]
    """(M, 4): amplitude_rad, period_s, offset_rad, phase_rad."""


class RayBatch(NamedTuple):
    """S scans that are computed together."""

    uav: NDArray[np.int64]
    """(S,) row of the UAV in the pose history and in the scene."""
    mount: NDArray[np.int64]
    """(S,) row in `mounts`."""
    sweep_start_ns: NDArray[np.int64]
    """(S,) time of the first beam, ns."""
    key: NDArray[np.uint64]
    """(S,) stream key of the sensor (core.rng.stream_key)."""
    scan_number: NDArray[np.int64]
    """(S,) number of the scan, counted from 0 by its sensor."""
    mounts: MountTable


@inner_kernel
def sensor_frame(batch: RayBatch, scan: int, history: PoseHistory, time_ns: int) -> Frame:
    """Returns the sensor's origin (m) and its x, y and z axes in the map frame at a time."""
    # Scalars only: slices would change reference counts in memory that threads share.
    row = batch.mount[scan]
    position, base, nods = batch.mounts
    x, y, z, px, py, pz, pw = pose_at(history, batch.uav[scan], time_ns)
    angle = nodding_angle(nods[row, 0], nods[row, 1], nods[row, 2], nods[row, 3], time_ns)
    qx, qy, qz, qw = nodded(base[row, 0], base[row, 1], base[row, 2], base[row, 3], angle)
    mx, my, mz = rotate_vector(px, py, pz, pw, position[row, 0], position[row, 1], position[row, 2])
    ax, ay, az, aw = quaternion_product(px, py, pz, pw, qx, qy, qz, qw)
    a, b, c = matrix_rows(ax, ay, az, aw)  # the columns are the sensor's axes
    return x + mx, y + my, z + mz, a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2]


@inner_kernel
def aim_packets(
    table: BeamTable,
    batch: RayBatch,
    scan: int,
    history: PoseHistory,
    first: int,
    count: int,
    rays: NDArray[np.float32],
) -> None:
    """Fills packets (P, PACKET_ROWS, LANES) with `count` packets of a scan, from packet `first` on.

    Neighbouring packets often share knots; the pose of a shared knot is read once.
    """
    start = batch.sweep_start_ns[scan]
    # Flat slices with constant offsets show the compiler that nothing overlaps, so that it
    # vectorizes the loop over the lanes.
    aims, out = table.lanes.reshape(table.lanes.size), rays.reshape(rays.size)
    knot_ns = table.knot_ns
    a_ns = b_ns = knot_ns[first, 0]
    a = b = sensor_frame(batch, scan, history, start + a_ns)
    for p in range(count):
        q = first + p
        if knot_ns[q, 0] != a_ns:
            a_ns = knot_ns[q, 0]
            a = b if a_ns == b_ns else sensor_frame(batch, scan, history, start + a_ns)
        if knot_ns[q, 1] != b_ns:
            b_ns = knot_ns[q, 1]
            b = sensor_frame(batch, scan, history, start + b_ns)
        if b_ns - a_ns > _LONGEST_CHORD_NS:
            _aim_one_by_one(table, batch, scan, history, q, rays, p)
            continue
        aim = aims[q * TABLE_ROWS * LANES : (q + 1) * TABLE_ROWS * LANES]
        ray = out[p * PACKET_ROWS * LANES : (p + 1) * PACKET_ROWS * LANES]
        ox, oy, oz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        xx, xy, xz = b[3] - a[3], b[4] - a[4], b[5] - a[5]
        yx, yy, yz = b[6] - a[6], b[7] - a[7], b[8] - a[8]
        zx, zy, zz = b[9] - a[9], b[10] - a[10], b[11] - a[11]
        for k in range(LANES):
            c, s, u, f = aim[k], aim[LANES + k], aim[2 * LANES + k], aim[3 * LANES + k]
            dx = c * (a[3] + f * xx) + s * (a[6] + f * yx) + u * (a[9] + f * zx)
            dy = c * (a[4] + f * xy) + s * (a[7] + f * yy) + u * (a[10] + f * zy)
            dz = c * (a[5] + f * xz) + s * (a[8] + f * yz) + u * (a[11] + f * zz)
            unit = 1.5 - 0.5 * (dx * dx + dy * dy + dz * dz)
            ray[ORIGIN * LANES + k] = a[0] + f * ox
            ray[(ORIGIN + 1) * LANES + k] = a[1] + f * oy
            ray[(ORIGIN + 2) * LANES + k] = a[2] + f * oz
            ray[DIRECTION * LANES + k] = dx * unit
            ray[(DIRECTION + 1) * LANES + k] = dy * unit
            ray[(DIRECTION + 2) * LANES + k] = dz * unit


@inner_kernel
def _aim_one_by_one(
    table: BeamTable,
    batch: RayBatch,
    scan: int,
    history: PoseHistory,
    packet: int,
    rays: NDArray[np.float32],
    p: int,
) -> None:
    """Fills packet `p` of `rays`, reading the pose for every ray."""
    start, end = table.knot_ns[packet, 0], table.knot_ns[packet, 1]
    aim = table.lanes
    for k in range(LANES):
        c, s, u, f = (aim[packet, 0, k], aim[packet, 1, k], aim[packet, 2, k], aim[packet, 3, k])
        after = start + round(f * (end - start))
        frame = sensor_frame(batch, scan, history, batch.sweep_start_ns[scan] + after)
        for j in range(3):
            rays[p, ORIGIN + j, k] = frame[j]
            rays[p, DIRECTION + j, k] = c * frame[3 + j] + s * frame[6 + j] + u * frame[9 + j]


@kernel
def sweep_rays(
    table: BeamTable,
    batch: RayBatch,
    scan: int,
    history: PoseHistory,
    packets: NDArray[np.float32],
    rays: NDArray[np.float32],
    times_ns: NDArray[np.int64],
) -> None:
    """Fills `rays` (6, beams) and the times at which they see other UAVs, for callers in Python."""
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
    """Fills `position` (N, 3) m and `attitude` (N, 4) with all UAVs' poses at a time, map frame."""
    for i in range(position.shape[0]):
        x, y, z, qx, qy, qz, qw = pose_at(history, i, time_ns)
        position[i, 0], position[i, 1], position[i, 2] = x, y, z
        attitude[i, 0], attitude[i, 1], attitude[i, 2], attitude[i, 3] = qx, qy, qz, qw
