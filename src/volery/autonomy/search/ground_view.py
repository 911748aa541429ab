"""Projects pixels of a camera to positions on a level plane, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import GraphError
from volery.core.vectors import norm
from volery.graph.messages import CameraInfo

Disc = tuple[float, float, float]

_STEEP = 0.17
"""Min downward component of a ray's direction, 10 degrees: flatter rays are too uncertain."""
_NEAR_M = 0.05
_BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of a mount (x forward, y left, z up) from optical ones (z forward, x right, y down)."""


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths and principal point, pixels; lens distortion is not corrected."""

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def from_message(cls, info: CameraInfo) -> Intrinsics:
        """Returns the intrinsics of a `camera_info`.

        Raises GraphError if the camera is not calibrated.
        """
        k = info.k
        if not (k[0] > 0.0 and k[4] > 0.0):
            raise GraphError("camera_info holds no focal length: the camera is not calibrated")
        return cls(float(k[0]), float(k[4]), float(k[2]), float(k[5]))


class GroundView:
    """A camera at `mount_m` (3,) in the body, rotated by `mount_rpy_deg` (3,)."""

    def __init__(
        self, intrinsics: Intrinsics, mount_m: Sequence[float], mount_rpy_deg: Sequence[float]
    ) -> None:
        self._k = intrinsics
        self._mount = np.array(mount_m, dtype=np.float64)
        turn = rotations.matrix(rotations.from_rpy(*np.radians(mount_rpy_deg)))
        self._body_from_optical: Array = turn @ _BODY_FROM_OPTICAL

    def position_of(self, u: float, v: float, pose: OdometrySample, plane_z: float) -> Array | None:
        """Returns the intersection (3,) of a pixel's ray with the plane at `plane_z`, map frame.

        Returns None if the ray points up, or down by less than 10 degrees. An object whose visible
        part lies dz above the plane is placed too far from the camera by dz tan(angle off the
        vertical); an attitude error e causes an error of about e times the distance.
        """
        optical = np.array([(u - self._k.cx) / self._k.fx, (v - self._k.cy) / self._k.fy, 1.0])
        ray = rotations.rotate(pose.attitude, self._body_from_optical @ optical)
        if ray[2] > -_STEEP * norm(ray):
            return None
        eye = pose.position + rotations.rotate(pose.attitude, self._mount)
        position: Array = eye + (plane_z - eye[2]) / ray[2] * ray
        return position if eye[2] > plane_z else None

    def disc_of(
        self, position: Array, radius_m: float, pose: OdometrySample
    ) -> tuple[float, float, float] | None:
        """Returns the image disc (column, row, radius; pixels) of a ball at `position` (3,) m.

        Returns None if the ball is behind the camera.
        """
        body = rotations.rotate(rotations.conjugate(pose.attitude), position - pose.position)
        x, y, z = self._body_from_optical.T @ (body - self._mount)
        if z < _NEAR_M:
            return None
        return (
            float(self._k.fx * x / z + self._k.cx),
            float(self._k.fy * y / z + self._k.cy),
            float(self._k.fx * radius_m / z),
        )


def pose_at(pose: OdometrySample, time_ns: int) -> OdometrySample:
    """Returns a pose extrapolated to another time by its velocity and angular velocity."""
    dt = (time_ns - pose.time_ns) * 1e-9
    turned = rotations.multiply(pose.attitude, rotations.exponential(pose.omega_body * dt))
    return OdometrySample(
        time_ns, pose.position + pose.velocity * dt, turned, pose.velocity, pose.omega_body
    )
