"""Publishes LIDAR scans as LaserScan, MultiEchoLaserScan or PointCloud2.

A planar scanner publishes `sensor_msgs/LaserScan`, and with several echoes also
`sensor_msgs/MultiEchoLaserScan`; every other scanner publishes `sensor_msgs/PointCloud2` with the
fields of `sensors.point_cloud.POINT`. Arrays are read-only views of the scans' arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.graph.graph import Graph
from volery.graph.messages import (
    LaserEcho,
    LaserScan,
    MultiEchoLaserScan,
    PointCloud2,
    PointField,
    header,
    single,
)
from volery.graph.topics import Publisher
from volery.publishing.lidar_returns import ReturnsPublisher
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.lidar.point_cloud import POINT, PointMaker
from volery.sensors.lidar.scan_patterns import PlanarScan
from volery.sensors.mount import Mount
from volery.sensors.samples import LidarScans, SensorId

_NO_INTENSITIES = np.zeros(0, dtype=np.float32)
_NO_INTENSITIES.flags.writeable = False
_DATATYPE = {"<f4": PointField.FLOAT32, "<u2": PointField.UINT16}
_FIELDS = [
    PointField(name, POINT.fields[name][1], _DATATYPE[POINT.fields[name][0].str], 1)
    for name in POINT.names or ()
    if POINT.fields is not None
]


def laser_frame(sensor: SensorId) -> str:
    """Returns the frame of a LIDAR."""
    return f"{sensor.uav_name}/laser_{sensor.name}"


def lidar_topic(sensor: SensorId, model: LidarModel, topic: str | None = None) -> str:
    """Returns the topic of a LIDAR's scans or points; `topic`: the scenario's relative name."""
    if topic is None:
        topic = f"laser/{sensor.name}/scan" if isinstance(model.scan, PlanarScan) else "points"
    return f"/{sensor.uav_name}/{topic}"


def cloud_points(message: Any) -> NDArray[Any]:
    """Returns the points of a PointCloud2 made by Volery, (N,) of `POINT`; a view."""
    points: NDArray[Any] = np.asarray(message.data).view(POINT)
    return points


class LidarPublisher:
    """Publishes the scans of all LIDARs."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._scans: dict[str, Publisher] = {}
        self._echoes: dict[str, Publisher] = {}
        self._clouds: dict[str, Publisher] = {}
        self._returns = ReturnsPublisher(graph)

    def announce(
        self, sensor: SensorId, model: LidarModel, topic: str, mount: Mount, *, local: bool
    ) -> list[Publisher]:
        """Advertises a LIDAR's topics; all echoes go to `echoes`, in the scan topic's namespace.

        local: in a divided run, this machine samples the LIDAR. Returns the publishers.
        """
        made = self._returns.announce(sensor, mount, topic, local=local)
        if not isinstance(model.scan, PlanarScan):
            self._clouds[sensor.path] = self._graph.advertise(topic, PointCloud2, local=local)
            return [*made, self._clouds[sensor.path]]
        self._scans[sensor.path] = self._graph.advertise(topic, LaserScan, local=local)
        made.append(self._scans[sensor.path])
        if model.echoes > 1:
            beside = f"{topic.rsplit('/', 1)[0]}/echoes"
            self._echoes[sensor.path] = self._graph.advertise(
                beside, MultiEchoLaserScan, local=local
            )
            made.append(self._echoes[sensor.path])
        return made

    def retire(self, uav_name: str) -> None:
        """Ends the publishers of a UAV's LIDARs."""
        self._returns.retire(uav_name)
        for publishers in (self._scans, self._echoes, self._clouds):
            for path in [path for path in publishers if path.startswith(f"{uav_name}/")]:
                publishers.pop(path).cancel()

    def publish(self, scans: LidarScans) -> None:
        """Queues the messages of one sweep of a bank, for topics with subscribers."""
        self._returns.publish(scans)
        if not isinstance(scans.model.scan, PlanarScan):
            self._publish_clouds(scans)
            return
        for row, sensor in enumerate(scans.sensors):
            publisher = self._scans[sensor.path]
            if publisher.has_subscribers:
                publisher.publish(_scan_message(scans, scans.model.scan, row))
            several = self._echoes.get(sensor.path)
            if several is not None and several.has_subscribers:
                several.publish(_echo_message(scans, scans.model.scan, row))

    def _publish_clouds(self, scans: LidarScans) -> None:
        maker: PointMaker | None = None
        for row, sensor in enumerate(scans.sensors):
            publisher = self._clouds[sensor.path]
            if not publisher.has_subscribers:
                continue
            maker = maker or PointMaker(scans)
            stamped = header(scans.stamp_ns, laser_frame(sensor))
            publisher.publish(_cloud_message(stamped, maker.points(row)))


def _scan_message(scans: LidarScans, pattern: PlanarScan, row: int) -> LaserScan:
    intensities = scans.intensities[row]
    return LaserScan(
        **_head(scans, pattern, row),
        ranges=scans.echoes[row, 0],
        intensities=intensities[0] if len(intensities) else _NO_INTENSITIES,
    )


def _echo_message(scans: LidarScans, pattern: PlanarScan, row: int) -> MultiEchoLaserScan:
    """Returns all echoes; a beam without echoes has its first range only, +-inf."""
    ranges = np.ascontiguousarray(scans.echoes[row].T)
    count = np.maximum(np.isfinite(ranges).sum(axis=1), 1).tolist()
    intensities = np.ascontiguousarray(scans.intensities[row].T)
    for array in (ranges, intensities):
        array.flags.writeable = False
    return MultiEchoLaserScan(
        **_head(scans, pattern, row),
        ranges=[LaserEcho(beam[:n]) for beam, n in zip(ranges, count, strict=True)],
        intensities=[LaserEcho(beam[:n]) for beam, n in zip(intensities, count, strict=True)]
        if intensities.size
        else [],
    )


def _head(scans: LidarScans, pattern: PlanarScan, row: int) -> dict[str, Any]:
    """Returns the fields that both messages share."""
    numbers = {
        "angle_min": pattern.angle_min_rad,
        "angle_max": pattern.angle_max_rad,
        "angle_increment": pattern.angle_increment_rad,
        "time_increment": pattern.time_increment_s,
        "scan_time": 1.0 / pattern.rate_hz,
        "range_min": scans.model.range.min_m,
        "range_max": scans.model.range.max_m,
    }
    return {
        "header": header(scans.stamp_ns, laser_frame(scans.sensors[row])),
        **{name: single(number) for name, number in numbers.items()},
    }


def _cloud_message(stamped: Any, points: NDArray[Any]) -> PointCloud2:
    return PointCloud2(
        stamped,
        1,  # height: unorganized
        len(points),
        list(_FIELDS),
        False,  # little-endian
        POINT.itemsize,
        POINT.itemsize * len(points),
        points.view(np.uint8),
        True,  # dense: no NaN
    )
