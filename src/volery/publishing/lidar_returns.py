"""What LIDARs saw, for people who watch: `/uavN/laser/NAME/points`.

A few hundred returns of each sweep in the frame of the UAV, with the nodding of the mount worked
in, so that a page that knows where the UAV is can draw them. Only clients outside are shown them:
whoever measures with a LIDAR reads its scans or points.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.graph.graph import Graph, Publisher
from volery.graph.messages import PointCloud2, PointField, header
from volery.sensors.mount import Mount, nodding_angle_at
from volery.sensors.samples import LidarScans, SensorId
from volery.sensors.scan_patterns import PlanarScan, ScanPattern

Array = NDArray[np.float64]

MOST_RETURNS = 360
"""Of a planar sweep that are shown: one a degree of the horizon ..."""
MOST_RETURNS_OF_VOLUMES = 2048
"""... and of a scanner that sees the third dimension."""
_KNOTS = 5
"""Instants of a sweep between which a nodding mount turns evenly."""
_FIELDS = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz")]
_STEP = 12


class ReturnsPublisher:
    """Shows the returns of all LIDARs that somebody watches."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._lidars: dict[str, tuple[Publisher, Mount]] = {}

    def announce(self, sensor: SensorId, mount: Mount, topic: str) -> None:
        """Advertise the returns of a LIDAR; not where its own points go by that name."""
        if topic != returns_topic(sensor):
            publisher = self._graph.advertise(returns_topic(sensor), PointCloud2)
            self._lidars[sensor.path] = publisher, mount

    def retire(self, uav_name: str) -> None:
        """Show no more of the LIDARs of a UAV."""
        for path in [path for path in self._lidars if path.startswith(f"{uav_name}/")]:
            publisher, _mount = self._lidars.pop(path)
            publisher.cancel()

    def publish(self, scans: LidarScans) -> None:
        """Show one sweep of a bank."""
        for row, sensor in enumerate(scans.sensors):
            publisher, mount = self._lidars.get(sensor.path, (None, None))
            if publisher is not None and mount is not None and publisher.watched:
                publisher.show(returns_message(scans, row, mount))


def returns_topic(sensor: SensorId) -> str:
    """Topic of the returns of a LIDAR."""
    return f"/{sensor.uav_name}/laser/{sensor.name}/points"


def returns_message(scans: LidarScans, row: int, mount: Mount) -> PointCloud2:
    """First echoes of evenly chosen beams of one sensor, x y z (float32) in the UAV's base frame.

    Every beam is turned by the mount as it stood when it was fired. The stamp is the middle of the
    sweep: the UAV's own motion during it is left in.
    """
    pattern = scans.model.scan
    ranges = scans.ranges[row]
    beams = _chosen_beams(pattern)
    beams = beams[np.isfinite(ranges[beams])]
    along = pattern.directions(scans.number)[:, beams].T * ranges[beams, None]
    points = _in_body(along, pattern.time_ns[beams], scans, mount).astype(np.float32)
    data = points.reshape(-1).view(np.uint8)
    data.flags.writeable = False
    stamp_ns = scans.stamp_ns + scans.model.sweep_duration_ns // 2
    frame = f"{scans.sensors[row].uav_name}/base_link"
    return PointCloud2(
        header(stamp_ns, frame),
        1,  # height: unorganized
        len(points),
        list(_FIELDS),
        False,  # little-endian
        _STEP,
        _STEP * len(points),
        data,
        True,  # dense: no NaN
    )


def _chosen_beams(pattern: ScanPattern) -> NDArray[np.int64]:
    """Evenly spaced numbers of beams; of a scanner with rings, of all rings in turn."""
    planar = isinstance(pattern, PlanarScan)
    step = -(-pattern.beam_count // (MOST_RETURNS if planar else MOST_RETURNS_OF_VOLUMES))
    while math.gcd(step, pattern.stride) > 1:
        step += 1
    return np.arange(0, pattern.beam_count, step)


def _in_body(along: Array, time_ns: NDArray[np.int64], scans: LidarScans, mount: Mount) -> Array:
    """Points (n, 3) from the sensor's frame, each at its own time, to the body."""
    if mount.nods:
        knots = np.linspace(0, scans.model.sweep_duration_ns, _KNOTS).astype(np.int64)
        angles = [nodding_angle_at(mount, scans.stamp_ns + int(knot)) for knot in knots]
        nod = np.interp(time_ns, knots, angles)
        x, y, z = along.T
        c, s = np.cos(nod), np.sin(nod)  # about the sensor's y axis, positive looks down
        along = np.stack([c * x + s * z, y, c * z - s * x], axis=-1)
    return along @ rotations.matrix(mount.attitude_body).T + mount.position_body
