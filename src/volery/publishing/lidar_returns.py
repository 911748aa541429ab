"""Publishes LIDAR returns for display: `/uavN/laser/NAME/points`.

A few hundred returns of each sweep in the frame of the UAV, corrected for a nodding mount, so that
a page that knows the UAV's pose can draw them. Only external clients receive them: nodes use the
LIDAR's scans or points.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.graph.graph import Graph
from volery.graph.messages import PointCloud2, PointField, header
from volery.graph.topics import Publisher
from volery.sensors.lidar.scan_patterns import PlanarScan, ScanPattern
from volery.sensors.mount import Mount, nodding_angle_at
from volery.sensors.samples import LidarScans, SensorId

MAX_RETURNS = 360
"""Maximum returns of a planar sweep: one per degree of the horizon ..."""
MAX_RETURNS_3D = 2048
"""... and of a three-dimensional scanner."""
_KNOTS = 5
"""Instants of a sweep between which the nodding angle is interpolated linearly."""
_FIELDS = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz")]
_STEP = 12


class ReturnsPublisher:
    """Publishes the returns of all LIDARs with external subscribers."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._lidars: dict[str, tuple[Publisher, Mount]] = {}

    def announce(
        self, sensor: SensorId, mount: Mount, topic: str, *, local: bool
    ) -> list[Publisher]:
        """Advertises a LIDAR's returns, unless its own points have that topic."""
        if topic == returns_topic(sensor):
            return []
        publisher = self._graph.advertise(returns_topic(sensor), PointCloud2, local=local)
        self._lidars[sensor.path] = publisher, mount
        return [publisher]

    def retire(self, uav_name: str) -> None:
        """Ends the publishers of a UAV's LIDARs."""
        for path in [path for path in self._lidars if path.startswith(f"{uav_name}/")]:
            publisher, _mount = self._lidars.pop(path)
            publisher.cancel()

    def publish(self, scans: LidarScans) -> None:
        """Publishes one sweep of a bank."""
        for row, sensor in enumerate(scans.sensors):
            publisher, mount = self._lidars.get(sensor.path, (None, None))
            if publisher is not None and mount is not None and publisher.has_external_subscribers:
                publisher.publish_external(returns_message(scans, row, mount))


def returns_topic(sensor: SensorId) -> str:
    """Returns the topic of a LIDAR's returns."""
    return f"/{sensor.uav_name}/laser/{sensor.name}/points"


def returns_message(scans: LidarScans, row: int, mount: Mount) -> PointCloud2:
    """Returns first echoes of evenly spaced beams of a sensor, x y z (float32), in the UAV's frame.

    Every beam is rotated by the mount's angle at its own time. The stamp is the middle of the
    sweep; the UAV's own motion during the sweep is not corrected.
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
    """Returns evenly spaced beam numbers; for a scanner with rings, from all rings in turn."""
    planar = isinstance(pattern, PlanarScan)
    step = -(-pattern.beam_count // (MAX_RETURNS if planar else MAX_RETURNS_3D))
    while math.gcd(step, pattern.stride) > 1:
        step += 1
    return np.arange(0, pattern.beam_count, step)


def _in_body(along: Array, time_ns: NDArray[np.int64], scans: LidarScans, mount: Mount) -> Array:
    """Transforms points (n, 3) from the sensor's frame, each at its own time, to the body."""
    if mount.nods:
        knots = np.linspace(0, scans.model.sweep_duration_ns, _KNOTS).astype(np.int64)
        angles = [nodding_angle_at(mount, scans.stamp_ns + int(knot)) for knot in knots]
        nod = np.interp(time_ns, knots, angles)
        x, y, z = along.T
        c, s = np.cos(nod), np.sin(nod)  # about the sensor's y axis, positive looks down
        along = np.stack([c * x + s * z, y, c * z - s * x], axis=-1)
    return along @ rotations.matrix(mount.attitude_body).T + mount.position_body
