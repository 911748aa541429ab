"""Publishes camera images; makes only the parts of images that have subscribers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from volery.graph.graph import Graph
from volery.graph.messages import CameraInfo, CompressedImage, Image, PointCloud2
from volery.graph.topics import Publisher
from volery.publishing import camera_messages as messages
from volery.publishing.camera_messages import Camera
from volery.scenario.camera import CameraSensor
from volery.sensors.cameras.camera import Part
from volery.sensors.samples import CameraFrames, SensorId

_LABELS_INSTANCE, _LABELS_MATERIAL = 0.5, 0.2
_RAW_COLOUR, _PNG_COLOUR, _JPEG_COLOUR = 3.0, 1.8, 0.5
_RAW_DEPTH = {"32FC1": 3.8, "16UC1": 1.0}
_COMPRESSED_DEPTH = 1.2
_POINTS = 15.0
"""Bytes per pixel after LZ4 in a log, for a forest by day: measured on `forest_cameras`."""


class _CameraTopic(NamedTuple):
    """A topic of a camera."""

    suffix: str
    message_class: type[Any]
    message: Callable[[CameraFrames, int, Camera], Any]
    parts: Callable[[CameraSensor], tuple[Part, ...]]
    """Parts of an image that the message needs; empty: the camera lacks the topic."""


def _always(*parts: Part) -> Callable[[CameraSensor], tuple[Part, ...]]:
    return lambda _: parts


def _if_compressed(part: Part) -> Callable[[CameraSensor], tuple[Part, ...]]:
    return lambda settings: () if settings.compressed == "none" else (part,)


def _of_points(settings: CameraSensor) -> tuple[Part, ...]:
    parts: dict[str, tuple[Part, ...]] = {
        "none": (),
        "xyz": ("depth",),
        "xyzrgb": ("colour", "depth"),
    }
    return parts[settings.points]


_TOPICS = (
    _CameraTopic("/image_raw", Image, messages.colour, _always("colour")),
    _CameraTopic(
        "/image_raw/compressed", CompressedImage, messages.compressed, _if_compressed("colour")
    ),
    _CameraTopic("/depth", Image, messages.depth, _always("depth")),
    _CameraTopic(
        "/depth/compressedDepth",
        CompressedImage,
        messages.compressed_depth,
        _if_compressed("depth"),
    ),
    _CameraTopic("/points", PointCloud2, messages.points, _of_points),
    # Intrinsics come with the cheapest part.
    _CameraTopic("/camera_info", CameraInfo, messages.camera_info, _always("depth")),
    _CameraTopic("/labels/instance", Image, messages.instance, _always("labels")),
    _CameraTopic("/labels/material", Image, messages.material, _always("labels")),
)


class _Outlet(NamedTuple):
    """An advertised topic of a camera."""

    publisher: Publisher
    message: Callable[[CameraFrames, int, Camera], Any]
    parts: tuple[Part, ...]


class CameraPublisher:
    """Publishes the images of all cameras."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._cameras: dict[str, Camera] = {}
        self._outlets: dict[str, list[_Outlet]] = {}
        self._pixels: dict[str, int] = {}

    def announce(self, camera: Camera, *, local: bool) -> list[Publisher]:
        """Advertises a camera's topics, and returns their publishers.

        local: in a divided run, this machine samples the camera.
        """
        sensor = camera.sensor
        self._cameras[sensor.path] = camera
        outlets = self._outlets[sensor.path] = []
        for topic in _TOPICS:
            if parts := topic.parts(camera.settings):
                name = f"/{sensor.path}{topic.suffix}"
                publisher = self._graph.advertise(name, topic.message_class, local=local)
                outlets.append(_Outlet(publisher, topic.message, parts))
        return [outlet.publisher for outlet in outlets]

    def set_size(self, cameras: Sequence[SensorId], pixels: int) -> None:
        """Sets the number of pixels of these cameras' images."""
        self._pixels.update((sensor.path, pixels) for sensor in cameras)

    def log_rates(self) -> dict[str, float]:
        """Returns the approximate log size of each topic, bytes per second of simulated time."""
        return {
            f"/{path}{end}": size * camera.settings.rate_hz
            for path, camera in self._cameras.items()
            for end, size in _bytes_per_image(camera.settings, self._pixels.get(path, 0)).items()
        }

    def retire(self, uav_name: str) -> None:
        """Ends the publishers of a UAV's cameras."""
        for path in [path for path in self._cameras if path.startswith(f"{uav_name}/")]:
            del self._cameras[path]
            for outlet in self._outlets.pop(path, ()):
                outlet.publisher.cancel()

    def subscribed_parts(self, cameras: Sequence[SensorId]) -> set[Part]:
        """Returns the parts of these cameras' images that have subscribers."""
        return {
            part
            for sensor in cameras
            for outlet in self._outlets[sensor.path]
            if outlet.publisher.has_subscribers
            for part in outlet.parts
        }

    def publish(self, frames: CameraFrames) -> None:
        """Queues the messages of one image of each camera, for topics with subscribers.

        A client that has subscribed since the image was made receives the next one.
        """
        made = {
            "colour": frames.colour.size > 0,
            "depth": frames.depth.size > 0,
            "labels": frames.instance.size > 0,
        }
        for row, sensor in enumerate(frames.sensors):
            camera = self._cameras[sensor.path]
            for outlet in self._outlets[sensor.path]:
                if outlet.publisher.has_subscribers and all(made[part] for part in outlet.parts):
                    outlet.publisher.publish(outlet.message(frames, row, camera))


def _bytes_per_image(settings: CameraSensor, pixels: int) -> dict[str, float]:
    """Returns the approximate log size of an image in bytes, by topic suffix.

    pixels: number of pixels of an image.
    """
    compressed = _JPEG_COLOUR if settings.compressed == "jpeg" else _PNG_COLOUR
    each = {
        "/image_raw": _RAW_COLOUR,
        "/image_raw/compressed": compressed if settings.compressed != "none" else 0.0,
        "/depth": _RAW_DEPTH[settings.depth_encoding],
        "/depth/compressedDepth": _COMPRESSED_DEPTH if settings.compressed != "none" else 0.0,
        "/points": _POINTS if settings.points != "none" else 0.0,
        "/labels/instance": _LABELS_INSTANCE,
        "/labels/material": _LABELS_MATERIAL,
    }
    return {end: size * pixels for end, size in each.items() if size}
