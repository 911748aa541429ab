"""Messages of two UAVs, made up so that each value is known, in a log of any format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from volery.bridges.logs import log_writer
from volery.graph import messages as m

PERIOD_NS = 100_000_000
COUNT = 20


def odometry(uav: int, k: int) -> m.Odometry:
    """Moves along x by 0.1 m a message, at y = uav and z = 2."""
    made = m.Odometry(header=m.header(k * PERIOD_NS, f"uav{uav}/odom"))
    made.pose.pose.position = m.Point(0.1 * k, float(uav), 2.0)
    made.pose.covariance = np.arange(36.0) + k
    return made


def scan(k: int, count: int = 5) -> m.LaserScan:
    return m.LaserScan(
        header=m.header(k * PERIOD_NS, "uav1/laser"),
        angle_min=-1.0,
        angle_increment=0.5,
        ranges=np.full(count, k, np.float32),
        intensities=np.zeros(0, np.float32),
    )


def transform(parent: str, child: str, k: int, x: float, q=(0.0, 0.0, 0.0, 1.0)):
    translation, rotation = m.Vector3(x, 0.0, 0.0), m.Quaternion(*q)
    return m.TransformStamped(
        m.header(k * PERIOD_NS, parent), child, m.Transform(translation, rotation)
    )


def image(k: int) -> m.Image:
    pixels = np.zeros((2, 3, 3), np.uint8)
    pixels[..., 0] = k  # blue
    pixels[..., 2] = 200  # red
    rows = np.concatenate([pixels.reshape(2, 9), np.zeros((2, 3), np.uint8)], axis=1)
    return m.Image(m.header(k * PERIOD_NS, "camera"), 2, 3, "bgr8", 0, 12, rows.reshape(-1))


def cloud(k: int) -> m.PointCloud2:
    points = np.zeros(4, np.dtype([("x", "<f4"), ("y", "<f4"), ("ring", "<u2")]))
    points["x"], points["ring"] = np.arange(4) + k, np.arange(4)
    fields = [
        m.PointField("x", 0, m.PointField.FLOAT32, 1),
        m.PointField("y", 4, m.PointField.FLOAT32, 1),
        m.PointField("ring", 8, m.PointField.UINT16, 1),
    ]
    data = points.view(np.uint8).reshape(-1)
    head = m.header(k * PERIOD_NS, "uav1/laser")
    return m.PointCloud2(head, 1, 4, fields, False, 10, 40, data, True)


def published() -> list[m.Published]:
    """All messages, in the order of their times."""
    found = [
        _made("/tf_static", 0, m.TFMessage([transform("uav1/base_link", "uav1/laser", 0, 0.2)]))
    ]
    for k in range(COUNT):
        for uav in (1, 2):
            found.append(_made(f"/uav{uav}/odom", k, odometry(uav, k)))
        found.append(_made("/uav1/scan", k, scan(k)))
        found.append(_made("/uav1/gappy_scan", k, scan(k, 3 + k % 2)))
        found.append(_made("/uav1/image", k, image(k)))
        found.append(_made("/uav1/points", k, cloud(k)))
        found.append(_made("/note", k, m.String(f"note {k}")))
        moving = transform("uav1/odom", "uav1/base_link", k, 1.0 * k)
        found.append(_made("/tf", k, m.TFMessage([moving])))
    return found


def write_log(path: Path) -> Path:
    """Writes the messages to a .mcap or .bag file."""
    log = log_writer.create_log(path)
    for message in published():
        log.write(message)
    log.close()
    return path


def write_sqlite_bag(folder: Path) -> Path:
    """Writes the messages to a ROS 2 bag with an SQLite file."""
    return write_ros2_bag(folder, "SQLITE3")


def write_ros2_bag(folder: Path, storage: str, compression: str = "NONE") -> Path:
    """Writes the messages to a ROS 2 bag.

    storage: `SQLITE3` or `MCAP`. compression: `NONE`, `FILE` or `MESSAGE`, by zstd.
    """
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    from volery.graph.typestore import typestore

    writer = Writer(folder, version=9, storage_plugin=StoragePlugin[storage])
    if compression != "NONE":
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for message in published():
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, message.msgtype, typestore=typestore()
                )
            writer.write(connections[message.topic], message.time_ns, message.cdr)
    return folder


def _made(topic: str, k: int, message: object) -> m.Published:
    return m.Published(topic, m.type_name(type(message)), k * PERIOD_NS, message)
