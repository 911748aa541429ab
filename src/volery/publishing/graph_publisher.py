"""Publishes sensor samples and events as messages on the graph.

Messages are built only for topics with subscribers. Their arrays are read-only and not shared.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array, read_only
from volery.engine.events import Event
from volery.graph.graph import Graph
from volery.graph.messages import (
    BatteryState,
    Clock,
    Imu,
    JointState,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Range,
    String,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
    single,
    time_from_ns,
)
from volery.graph.topics import Publisher
from volery.publishing.camera_messages import OPTICAL_ATTITUDE, Camera, optical_frame
from volery.publishing.camera_publishing import CameraPublisher
from volery.publishing.lidar_publishing import LidarPublisher, laser_frame
from volery.publishing.navigation_messages import NAVIGATION_TOPICS
from volery.publishing.sensor_topics import SensorTopic
from volery.publishing.transforms import transforms_of_odometry
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.mount import Mount, make_mount
from volery.sensors.samples import (
    BatterySamples,
    CameraFrames,
    ImuSamples,
    JointAngles,
    LidarScans,
    OdometrySamples,
    RangeSamples,
    Samples,
    SensorId,
)
from volery.vehicle.battery import BatteryLevel

_NO_EFFORT = np.zeros(0)
_UNKNOWN_ORIENTATION = np.full(9, 0.0)
_UNKNOWN_ORIENTATION[0] = -1.0
for _shared in (_NO_EFFORT, _UNKNOWN_ORIENTATION):
    _shared.flags.writeable = False
_IDENTITY = Quaternion(0.0, 0.0, 0.0, 1.0)
_MAX_CACHED = 1000


class _ReceivingRows(NamedTuple):
    """The sensors of some samples that have subscribers, until subscriptions change."""

    changes: int
    sensors: Sequence[SensorId]
    rows: list[int]


class GraphPublisher:
    """Publishes what the engine samples; one instance serves the whole fleet."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._publishers: dict[str, Publisher] = {}
        self._lidars = LidarPublisher(graph)
        self.cameras = CameraPublisher(graph)
        """Publisher of the cameras; returns which parts of images have subscribers."""
        self._mounts: dict[str, Mount] = {}
        self._of_sensor: dict[str, list[Publisher]] = {}
        """Publishers of each sensor, by its path."""
        self._receiving: dict[int, _ReceivingRows] = {}
        self._clock = graph.advertise("/clock", Clock)
        self._tf = graph.advertise("/tf", TFMessage)
        self._tf_static = graph.advertise("/tf_static", TFMessage, latched=True)
        self._events = graph.advertise("/events", String)
        self._static_sent = False
        self._static: list[TransformStamped] = []
        self._by_kind: dict[type[Any], Callable[[Any], None]] = {
            LidarScans: self._lidars.publish,
            CameraFrames: self.cameras.publish,
            OdometrySamples: self._odometry,
            JointAngles: self._joints,
            **dict.fromkeys(SENSOR_TOPICS, self._by_topic),
        }

    def announce(
        self, sensor: SensorId, kind: type[Any], mount: Mount, *, in_map: bool = True
    ) -> None:
        """Advertises a sensor's topics and adds its static transform.

        in_map: the odometry frame is fixed to the map; otherwise a node publishes its pose on
        `/tf`.
        """
        self._static_sent = False
        self._mounts[sensor.path] = mount
        base = f"{sensor.uav_name}/base_link"
        if kind is JointAngles:
            self._advertise(f"/{sensor.uav_name}/joint_states", JointState, sensor)
        elif kind is OdometrySamples:
            self._advertise(_odometry_topic(sensor), Odometry, sensor)
            if sensor.name == "odom" and in_map:
                self._static.append(_fixed_frame("map", f"{sensor.uav_name}/odom"))
        else:
            for topic in SENSOR_TOPICS[kind]:
                self._advertise(topic.name_of(sensor), topic.message_class, sensor)
            if kind is not BatterySamples:
                self._static.append(_mount_transform(base, sensor.path, mount))

    def announce_camera(self, camera: Camera, mount: Mount, *, local: bool = True) -> None:
        """Advertises a camera's topics, and adds the static transforms of its two frames.

        local: in a divided run, this machine samples the camera.
        """
        self._static_sent = False
        self._of_sensor[camera.sensor.path] = self.cameras.announce(camera, local=local)
        sensor, optical = camera.sensor, make_mount(attitude_body=OPTICAL_ATTITUDE)
        base = f"{sensor.uav_name}/base_link"
        self._static.append(_mount_transform(base, sensor.path, mount))
        self._static.append(_mount_transform(sensor.path, optical_frame(sensor), optical))

    def announce_lidar(
        self,
        sensor: SensorId,
        model: LidarModel,
        topic: str,
        mount: Mount,
        *,
        local: bool = True,
    ) -> None:
        """Advertises a LIDAR's topics and adds its static transform.

        local: in a divided run, this machine samples the LIDAR.
        """
        self._static_sent = False
        self._mounts[sensor.path] = mount
        made = self._lidars.announce(sensor, model, topic, mount, local=local)
        self._of_sensor[sensor.path] = made
        if not mount.nods:
            base = f"{sensor.uav_name}/base_link"
            self._static.append(_mount_transform(base, laser_frame(sensor), mount))

    def arrange(self, uav_names: Sequence[str]) -> None:
        """Sorts the static transforms by this order of UAVs; those of other UAVs come last."""
        rows = {name: row for row, name in enumerate(uav_names)}
        last = len(rows)
        self._static.sort(key=lambda t: rows.get(t.child_frame_id.split("/")[0], last))

    def causes_actions(self, sensors: Sequence[SensorId]) -> bool:
        """Returns whether a message of any of these sensors causes actions; see `Publisher`."""
        publishers = (each for sensor in sensors for each in self._of_sensor.get(sensor.path, ()))
        return self._tf.causes_actions or any(each.causes_actions for each in publishers)

    def retire(self, uav_name: str) -> None:
        """Ends the publishers of a UAV's sensors, and removes its static transforms."""
        below = f"/{uav_name}/"
        for path in [path for path in self._of_sensor if path.startswith(below[1:])]:
            del self._of_sensor[path]
        for topic in [topic for topic in self._publishers if topic.startswith(below)]:
            self._publishers.pop(topic).cancel()
        self._lidars.retire(uav_name)
        self.cameras.retire(uav_name)
        own = f"{uav_name}/"
        self._static = [t for t in self._static if not t.child_frame_id.startswith(own)]
        self._static_sent = False

    def publish(self, samples: Samples) -> None:
        """Queues the messages of one batch of samples; static transforms before the first."""
        if not self._static_sent:
            self._publish_static()
        self._by_kind[type(samples)](samples)

    def get_state(self) -> bool:
        """Returns the state for a snapshot."""
        return self._static_sent

    def set_state(self, state: bool) -> None:
        """Restores a saved state."""
        self._static_sent = state

    def publish_event(self, event: Event) -> None:
        """Queues an event as JSON text on `/events`."""
        if self._events.has_subscribers:
            self._events.publish(String(json.dumps(asdict(event))))

    @property
    def clock_wanted(self) -> bool:
        """Whether `/clock` has subscribers."""
        return self._clock.has_subscribers

    def publish_clock(self, time_ns: int) -> None:
        """Queues a message on `/clock`."""
        if self._clock.has_subscribers:
            self._clock.publish(Clock(time_from_ns(time_ns)))

    def _publish_static(self) -> None:
        self._static_sent = True
        if self._static:
            self._tf_static.publish(TFMessage(list(self._static)))

    # ---------------------------------------------------------------------------------- by kind

    def _odometry(self, readings: OdometrySamples) -> None:
        for i in self._receiving_rows(readings.sensors):
            sensor = readings.sensors[i]
            position = readings.position_odom[i].tolist()
            attitude = Quaternion(*readings.attitude[i].tolist())
            base = f"{sensor.uav_name}/base_link"
            frame = "map" if readings.is_ground_truth else f"{sensor.uav_name}/odom"
            publisher = self._publishers[_odometry_topic(sensor)]
            if not publisher.has_subscribers:
                continue
            twist = Twist(
                Vector3(*readings.velocity_body[i].tolist()),
                Vector3(*readings.omega_body[i].tolist()),
            )
            publisher.publish(
                Odometry(
                    header(readings.stamp_ns, frame),
                    base,
                    PoseWithCovariance(
                        Pose(Point(*position), attitude), _matrix(readings.pose_variance[i])
                    ),
                    TwistWithCovariance(twist, _matrix(readings.twist_variance[i])),
                )
            )
        if readings.sensors and not readings.is_ground_truth and self._tf.has_subscribers:
            names = [sensor.uav_name for sensor in readings.sensors]
            poses = np.hstack([readings.position_odom, readings.attitude])
            self._tf.publish(transforms_of_odometry(readings.stamp_ns, names, poses))

    def _joints(self, joints: JointAngles) -> None:
        transforms = []
        tf = self._tf.has_subscribers
        for i in self._receiving_rows(joints.sensors, every=tf):
            sensor = joints.sensors[i]
            mount = self._mounts[sensor.path]
            base = f"{sensor.uav_name}/base_link"
            angle = float(joints.angle[i])
            if tf:
                q = rotations.multiply(mount.attitude_body, rotations.from_rpy(0.0, angle, 0.0))
                transforms.append(
                    TransformStamped(
                        header(joints.stamp_ns, base),
                        laser_frame(sensor),
                        Transform(Vector3(*mount.position_body.tolist()), Quaternion(*q.tolist())),
                    )
                )
            publisher = self._publishers[f"/{sensor.uav_name}/joint_states"]
            if publisher.has_subscribers:
                publisher.publish(
                    JointState(
                        header(joints.stamp_ns, ""),
                        [f"laser_{sensor.name}"],
                        read_only(joints.angle[i : i + 1].copy()),
                        read_only(joints.rate[i : i + 1].copy()),
                        _NO_EFFORT,
                    )
                )
        if transforms:
            self._tf.publish(TFMessage(transforms))

    def _by_topic(self, samples: Any) -> None:
        for topic in SENSOR_TOPICS[type(samples)]:
            for row in self._receiving_rows(samples.sensors):
                publisher = self._publishers[topic.name_of(samples.sensors[row])]
                if publisher.has_subscribers:
                    message = topic.message(samples, row)
                    if message is not None:
                        publisher.publish(message)

    def _receiving_rows(self, sensors: Sequence[SensorId], *, every: bool = False) -> Sequence[int]:
        """Returns the rows of sensors with subscribers, or all."""
        if every:
            return range(len(sensors))
        found = self._receiving.get(id(sensors))
        if found is None or found.changes != self._graph.changes:
            rows = [row for row, sensor in enumerate(sensors) if self._has_receiver(sensor)]
            if len(self._receiving) > _MAX_CACHED:
                self._receiving.clear()
            found = self._receiving[id(sensors)] = _ReceivingRows(
                self._graph.changes, sensors, rows
            )
        return found.rows

    def _has_receiver(self, sensor: SensorId) -> bool:
        return any(each.has_subscribers for each in self._of_sensor.get(sensor.path, ()))

    def _advertise(self, topic: str, message_class: type[Any], sensor: SensorId) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._graph.advertise(topic, message_class)
        self._of_sensor.setdefault(sensor.path, []).append(self._publishers[topic])


def _imu(readings: ImuSamples, row: int) -> Imu:
    sensor = readings.sensors[row]
    return Imu(
        header(readings.stamp_ns, f"{sensor.uav_name}/{sensor.name}"),
        _IDENTITY,
        _UNKNOWN_ORIENTATION,
        Vector3(*readings.angular_velocity[row].tolist()),
        _diagonal(readings.angular_velocity_variance),
        Vector3(*readings.specific_force[row].tolist()),
        _diagonal(readings.specific_force_variance),
    )


def _range(readings: RangeSamples, row: int) -> Range:
    sensor = readings.sensors[row]
    return Range(
        header(readings.stamp_ns, f"{sensor.uav_name}/{sensor.name}"),
        Range.ULTRASOUND,
        single(readings.field_of_view_rad),
        single(readings.range_min_m),
        single(readings.range_max_m),
        single(readings.ranges[row]),
        0.0,
    )


def _battery_state(readings: BatterySamples, i: int) -> BatteryState:
    """Returns a BatteryState: current below 0 while discharging, NaN for unknown values."""
    cells = int(readings.cells[i])
    voltage, charge = float(readings.voltage[i]), float(readings.charge[i])
    capacity = float(readings.capacity_ah[i])
    dead = readings.level[i] == BatteryLevel.EMPTY
    return BatteryState(
        header(readings.stamp_ns, f"{readings.sensors[i].uav_name}/base_link"),
        single(voltage),
        math.nan,
        single(-readings.current[i]),
        single(charge * capacity),
        single(capacity),
        single(capacity),
        single(charge),
        BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        BatteryState.POWER_SUPPLY_HEALTH_DEAD if dead else BatteryState.POWER_SUPPLY_HEALTH_GOOD,
        BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
        True,
        _same(cells, voltage / cells),
        _same(cells, math.nan),
        "",
        "",
    )


def _same(count: int, value: float) -> NDArray[np.float32]:
    array = np.full(count, value, dtype=np.float32)
    array.flags.writeable = False
    return array


SENSOR_TOPICS: dict[type[Any], tuple[SensorTopic, ...]] = {
    ImuSamples: (SensorTopic("", Imu, _imu),),
    RangeSamples: (SensorTopic("", Range, _range),),
    BatterySamples: (SensorTopic("", BatteryState, _battery_state),),
    **NAVIGATION_TOPICS,
}
"""Topics of each kind of samples with one message per row."""


def _odometry_topic(sensor: SensorId) -> str:
    suffix = "ground_truth/odom" if sensor.name == "ground_truth" else sensor.name
    return f"/{sensor.uav_name}/{suffix}"


def _mount_transform(parent: str, child: str, mount: Mount) -> TransformStamped:
    return TransformStamped(
        header(0, parent),
        child,
        Transform(
            Vector3(*mount.position_body.tolist()), Quaternion(*mount.attitude_body.tolist())
        ),
    )


def _fixed_frame(parent: str, child: str) -> TransformStamped:
    return TransformStamped(header(0, parent), child, Transform(Vector3(0.0, 0.0, 0.0), _IDENTITY))


@lru_cache(maxsize=256)
def _diagonal(variance: float) -> Array:
    return read_only(np.diag([variance] * 3).reshape(9))


def _matrix(diagonal: Array) -> Array:
    matrix = np.zeros(36)
    matrix[::7] = diagonal
    return read_only(matrix)
