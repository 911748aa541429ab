"""The geometry of a camera that looks at a tag on the ground."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.tags.detector import quad_area
from volery.autonomy.policy.tag_terms import CAMERA_FROM_OPTICAL
from volery.core import rotations
from volery.core.arrays import Array
from volery.sensors.cameras.model import CameraModel
from volery.sensors.mount import Mount, make_mount
from volery.world.actors.tags import CELLS, tag_corners

_EDGE_PX = 2.0
"""Pixels at the image's edge that a tag's corners must not enter to be detected (measured)."""


class TagView(NamedTuple):
    """A tag in K images."""

    corners_px: Array
    """(K, 4, 2) columns and rows; nan behind the camera."""
    position_optical: Array
    """(K, 3) m, centre of the tag."""
    attitude_optical: Array
    """(K, 4) optical frame from tag."""
    is_whole: NDArray[np.bool_]
    """(K,) whether the black border lies in the image, face to the camera."""

    @property
    def cell_px(self) -> Array:
        """Sides (K,) of a cell, pixels; nan behind the camera."""
        return np.asarray(np.sqrt(quad_area(self.corners_px)) / CELLS)


@dataclass(frozen=True)
class TagCamera:
    """A camera below a UAV, and the side of the tag's black border."""

    model: CameraModel
    mount_m: tuple[float, float, float]
    mount_rpy_deg: tuple[float, float, float]
    tag_size_m: float
    tag_id: int = 0
    mount: Mount = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        turn = rotations.from_rpy(*np.radians(self.mount_rpy_deg))
        object.__setattr__(self, "mount", make_mount(self.mount_m, turn))

    def view(
        self, position: Array, attitude: Array, tag_position: Array, tag_yaw: Array
    ) -> TagView:
        """Returns the tags (K,) in the images of UAVs (K,); arrays (K, 3), (K, 4), (K, 3), (K,)."""
        corners = tag_corners(self.tag_size_m)
        centre = corners.mean(axis=0)
        turn = rotations.from_rpy(0.0 * tag_yaw, 0.0 * tag_yaw, tag_yaw)
        camera = rotations.multiply(attitude, self.mount.attitude_body)
        eye = position + rotations.rotate(attitude, self.mount.position_body)
        inverse = rotations.conjugate(camera)

        def optical(points_tag: Array) -> Array:
            """Returns points (P, 3) of the tags' frames in the optical frames, (K, P, 3)."""
            points = tag_position[:, None] + rotations.rotate(turn[:, None], points_tag)
            flu = rotations.rotate(inverse[:, None], points - eye[:, None])
            return np.stack([-flu[..., 1], -flu[..., 2], flu[..., 0]], axis=-1)

        seen = self.model.project(optical(corners))
        last = np.array([self.model.width - 1, self.model.height - 1])
        inside = (seen >= _EDGE_PX) & (seen <= last - _EDGE_PX)  # nan is outside
        above = eye[:, 2] > tag_position[:, 2] + centre[2]
        from_tag = rotations.multiply(inverse, turn)
        return TagView(
            seen,
            optical(centre[None])[:, 0],
            rotations.multiply(rotations.conjugate(CAMERA_FROM_OPTICAL), from_tag),
            inside.all(axis=(1, 2)) & above,
        )
