"""Detects tags in rendered images: the renderer and OpenCV's detector for K environments."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.autonomy.perception.tags.detector import DetectedTag, TagDetector, grey_of
from volery.autonomy.perception.tags.tag_pose import tag_pose
from volery.core.arrays import Array
from volery.learning.tags.camera import TagCamera
from volery.learning.tags.detections import TagDetections, no_detections
from volery.sensors.cameras.camera import Part, take
from volery.sensors.cameras.light import Light, make_light
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.vehicle.airframe import Airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.pose_history import new_history
from volery.world.actors import MovingActor, MovingActors
from volery.world.actors.motions import GivenMotion
from volery.world.actors.tags import tag_shape
from volery.world.scene import Scene
from volery.world.terrain import Terrain

_APART_M = 60.0
"""Distance of the environments' tags: farther than a camera below 10 m sees."""
_DT_NS = 1_000_000
_PARTS: tuple[Part, ...] = ("colour",)


class TagImages:
    """Renders the images of K cameras, each above a tag of its own, and detects the tags.

    The tags lie far apart on one flat ground at z = 0. Raises `VoleryError` without OpenCV.
    """

    def __init__(
        self, camera: TagCamera, airframe: Airframe, num_envs: int, *, threads: int = 2
    ) -> None:
        self._camera = camera
        self._detectors = [TagDetector() for _ in range(threads)]
        side = int(np.ceil(np.sqrt(num_envs)))
        grid = np.arange(num_envs)
        spot = np.column_stack([grid % side, grid // side, np.zeros(num_envs)]) - 0.5 * (side - 1)
        self._origin = _APART_M * spot * [1.0, 1.0, 0.0]
        shape = tag_shape(camera.tag_id, camera.tag_size_m)
        self._motions = [GivenMotion([*p, 0.0, 0.0, 0.0, 1.0]) for p in self._origin.tolist()]
        actors = [
            MovingActor(f"tag{k}", "tag", shape, motion, is_flat=True)
            for k, motion in enumerate(self._motions)
        ]
        half_width = _APART_M * side
        self._scene = Scene(
            Terrain.flat(2.0 * half_width, 0.0, origin=(-half_width, -half_width)),
            None,
            threads=threads,
        )
        self._scene.set_actors(MovingActors(actors))
        self._scene.set_bodies(
            [body_shape(airframe)], np.zeros(num_envs, np.int64), num_envs=num_envs
        )
        self._mounts = stack_mounts([camera.mount])
        self._light = make_light()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="volery-tags")

    def render(
        self,
        envs: NDArray[np.int64],
        position: Array,
        attitude: Array,
        tag_position: Array,
        tag_yaw: Array,
        *,
        keys: NDArray[np.uint64],
        number: ArrayLike = 0,
        light: Light | None = None,
    ) -> NDArray[np.uint8]:
        """Returns images (R, height, width, 3) of the environments `envs` (R,).

        position, attitude: of the UAVs, (R, 3) and (R, 4), map. tag_position, tag_yaw: (R, 3) and
        (R,). keys: (R,) noise of the images; number: of each image since the start.
        """
        shift = self._origin[envs] - tag_position * [1.0, 1.0, 0.0]
        everywhere = self._origin + np.array([0.0, 0.0, 1.0])
        level = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(everywhere), 4)).copy()
        everywhere[envs], level[envs] = position + shift, attitude
        half = 0.5 * tag_yaw
        for k, env in enumerate(envs.tolist()):
            turn = [0.0, 0.0, float(np.sin(half[k])), float(np.cos(half[k]))]
            at = [*self._origin[env][:2].tolist(), float(tag_position[k, 2])]
            self._motions[env].set_pose(0.0, [*at, *turn], [0.0, 0.0, 0.0])
        batch = make_batch(envs, 0, 0, keys, number, self._mounts)
        images = take(
            self._scene,
            self._camera.model,
            light or self._light,
            batch,
            new_history(everywhere, level, _DT_NS),
            parts=_PARTS,
        )
        assert images.colour is not None
        return images.colour

    def detect(self, images: NDArray[np.uint8]) -> TagDetections:
        """Returns the detections in images (R, height, width, 3)."""
        found = no_detections(len(images))
        pieces = np.array_split(np.arange(len(images)), len(self._detectors))
        done = [
            self._pool.submit(self._detect_some, detector, rows, images, found)
            for detector, rows in zip(self._detectors, pieces, strict=True)
        ]
        for piece in done:
            piece.result()
        return found

    def corners(self, image: NDArray[np.uint8]) -> DetectedTag | None:
        """Returns the tag in one image (height, width, 3), None without it."""
        tags = [
            tag
            for tag in self._detectors[0].detect(grey_of(image))
            if tag.id == self._camera.tag_id
        ]
        return tags[0] if tags else None

    def close(self) -> None:
        """Releases memory and threads."""
        self._pool.shutdown()
        self._scene.close()

    def _detect_some(
        self,
        detector: TagDetector,
        rows: NDArray[np.int64],
        images: NDArray[np.uint8],
        found: TagDetections,
    ) -> None:
        camera = self._camera
        for row in rows.tolist():
            for tag in detector.detect(grey_of(images[row])):
                pose = None
                if tag.id == camera.tag_id:
                    lens = np.array(camera.model.distortion)
                    pose = tag_pose(tag, camera.tag_size_m, camera.model.matrix, lens)
                if pose is not None:
                    found.is_detected[row] = True
                    found.position_optical[row] = pose.position
                    found.attitude_optical[row] = pose.attitude
                    break
