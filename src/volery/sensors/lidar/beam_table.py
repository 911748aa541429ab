"""Beams of one sweep for kernels: directions, times, and the order of casting.

Beams are numbered in the order of the messages. They are cast in packets of LANES neighbours,
whatever their number, because rays with similar directions cost half as much.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.world.embree import LANES

TABLE_ROWS = 4
KNOTS_APART_NS = 1_000_000
"""Largest time between knots.

Within a millisecond, the usual step of the physics, the pose interpolates linearly: at 10 m/s^2 and
10 rad/s^2 the midpoint is off by a micrometre and a microradian.
"""


class BeamTable(NamedTuple):
    """The rays of a sweep in casting order, L = P LANES lanes in P packets.

    The sensor's pose is read at the two knots of a packet and interpolated between them. Lanes
    beyond the last ray repeat it, so that kernels treat all packets alike.
    """

    rays: int
    """Number of rays, one per beam."""
    lanes: Array
    """(P, TABLE_ROWS, LANES): unit vector x, y, z in the sensor frame, FLU, and the time of the ray
    between its packet's knots, 0..1."""
    knot_ns: NDArray[np.int64]
    """(P, 2) ns after the start of the sweep."""
    seen_ns: NDArray[np.int64]
    """(P,) time at which a packet sees the other UAVs, ns after the start of the sweep."""
    beam: NDArray[np.uint32]
    """(L,) number of each ray's beam; lanes beyond the last ray have numbers beyond the last beam.
    Unsigned, so that kernels need no test for negative indices."""
    in_order: bool
    """Whether the casting order is the order of the beams."""


def packets_of(rays: int) -> int:
    """Returns the number of packets that `rays` rays need."""
    return (rays + LANES - 1) // LANES


def row_table(direction: Array, time_ns: NDArray[np.int64]) -> BeamTable:
    """Returns the table of a planar sweep: evenly timed beams, cast in order.

    `direction` (3, R) are unit vectors in the sensor frame, `time_ns` (R,) times after the start of
    the sweep. Packets that fit in KNOTS_APART_NS share their knots: their first beam and that of
    the packet after them, so that each pose is read once.
    """
    beams = len(time_ns)
    packets = packets_of(beams)
    packet_ns = max(int(time_ns[min(LANES, beams - 1)] - time_ns[0]), 1)
    shared = LANES * max(KNOTS_APART_NS // packet_ns, 1)
    first = LANES * np.arange(packets) // shared * shared
    last = np.minimum(first + shared, beams - 1)
    ray = np.arange(beams)
    step = 1.0 / np.maximum(last - first, 1)
    return BeamTable(
        rays=beams,
        lanes=in_packets(direction, (ray - first[ray // LANES]) * step[ray // LANES]),
        knot_ns=np.column_stack([time_ns[first], time_ns[last]]),
        seen_ns=time_ns[np.minimum(LANES * np.arange(packets) + LANES // 2, beams - 1)],
        beam=_padded(ray),
        in_order=True,
    )


def block_table(
    direction: Array,
    time_ns: NDArray[np.int64],
    order: NDArray[np.int64],
    block: NDArray[np.int64],
) -> BeamTable:
    """Returns the table of beams cast in `order` (R,), a permutation of their numbers.

    `direction` (3, R) are unit vectors in the sensor frame, `time_ns` (R,) times after the start of
    the sweep. `block` (R,) numbers groups of beams that are close in time, in beam order: all
    packets of a block share their knots, which saves reading poses.
    """
    start = np.full(int(block.max()) + 1, np.iinfo(np.int64).max)
    end = np.zeros_like(start)
    np.minimum.at(start, block, time_ns)
    np.maximum.at(end, block, time_ns)
    heads = np.arange(0, len(order), LANES)
    knots = np.column_stack(
        [
            np.minimum.reduceat(start[block[order]], heads),
            np.maximum.reduceat(end[block[order]], heads),
        ]
    )
    packet = np.arange(len(order)) // LANES
    length = np.maximum(knots[:, 1] - knots[:, 0], 1)
    return BeamTable(
        rays=len(order),
        lanes=in_packets(direction[:, order], (time_ns[order] - knots[packet, 0]) / length[packet]),
        knot_ns=knots,
        seen_ns=knots.sum(axis=1) // 2,
        beam=_padded(order),
        in_order=bool((order == np.arange(len(order))).all()),
    )


def in_packets(direction: Array, fraction: Array) -> Array:
    """Returns lanes (P, TABLE_ROWS, LANES) of rays (3, R) and fractions (R,) in casting order."""
    count = len(fraction)
    ray = np.minimum(np.arange(packets_of(count) * LANES), count - 1)
    rows = np.vstack([direction, fraction])[:, ray]
    return np.ascontiguousarray(rows.reshape(TABLE_ROWS, -1, LANES).swapaxes(0, 1))


def _padded(order: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Returns the order, padded with unused numbers to whole packets."""
    rest = np.arange(len(order), packets_of(len(order)) * LANES)
    return np.concatenate([order, rest]).astype(np.uint32)
